"""What was written is read back bit for bit, from every format."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import DataError, MissingExtra, UsageError
from evertwin.signals import Layout
from evertwin.signals.series import Series
from evertwin.sources import Cell, Clock, Recorded, open_recording, write
from evertwin.sources.foreign import load
from evertwin.sources.texts.small_table import read_table
from evertwin.sources.writers import WRITERS

LAYOUT = Layout.of(v="m/s", w="rad/s")


def series(n: int = 500, seed: int = 0) -> Series:
    rng = np.random.default_rng(seed)
    t = 1_614_859_007_119_846_022 + np.cumsum(rng.integers(1, 10**8, n))
    v = rng.normal(size=(n, 2)) * 10.0 ** rng.integers(-12, 12, (n, 1))
    v[7, 0] = np.nan
    return Series(LAYOUT, t, v)


def read(path: Path, prefix: str = "") -> Series:
    cells = tuple(Cell(c.name, f"{prefix}{c.name}", c.unit) for c in LAYOUT)
    chunks = list(Recorded("run", (path,), cells).read())
    t = np.concatenate([c.t for c in chunks])
    return Series(LAYOUT, t, np.concatenate([c.v for c in chunks]))


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_round_trip(tmp_path: Path, suffix: str) -> None:
    one = series()
    write(tmp_path / f"run{suffix}", {"drive": one})
    back = read(tmp_path / f"run{suffix}")
    assert back.t.tolist() == one.t.tolist()
    assert back.v.tobytes() == one.v.tobytes()


def test_round_trip_of_two_topics(tmp_path: Path) -> None:
    one, two = series(), series(100, 1)
    one.v[7, 0] = 1.0
    two.v[7, 0] = 2.0
    write(tmp_path / "run.mcap", {"drive": one, "pose": two})
    for name, expected in (("drive", one), ("pose", two)):
        back = read(tmp_path / "run.mcap", f"{name}.")
        assert back.t.tolist() == expected.t.tolist()
        assert back.v.tobytes() == expected.v.tobytes()


def test_a_missing_value_in_mcap_is_counted(tmp_path: Path) -> None:
    write(tmp_path / "run.mcap", {"drive": series(50)})
    source = Recorded("run", (tmp_path / "run.mcap",), (Cell("v", "drive.v", "m/s"),))
    assert sum(len(c.t) for c in source.read()) == 49
    assert source.tally.counts == {"truncated": 1}


def test_units_are_written_and_read(tmp_path: Path) -> None:
    for suffix in (".csv", ".parquet"):
        write(tmp_path / f"run{suffix}", {"drive": series()})
        table = open_recording(tmp_path / f"run{suffix}").tables[0]
        assert [c.unit for c in table.columns][1:] == ["m/s", "rad/s"]


def test_writer_refuses(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"\.mcap"):
        write(tmp_path / "run.xlsx", {"a": series()})
    with pytest.raises(UsageError, match="one series"):
        write(tmp_path / "run.csv", {"a": series(), "b": series()})
    assert sorted(WRITERS) == [".csv", ".mcap", ".npz", ".parquet"]


def test_mat_structures_and_matrices(tmp_path: Path) -> None:
    q = np.arange(20.0).reshape(10, 2)
    log = {"on": np.ones(10, bool), "name": "arm"}
    scipy.io.savemat(tmp_path / "run.mat", {"t": np.arange(10) / 100, "q": q, "log": log, "k": 3.0})
    recording = open_recording(tmp_path / "run.mat")
    assert [c.name for c in recording.tables[0].columns] == ["t", "q.1", "q.2", "log.on"]
    assert len(recording.notes) == 2
    rows = next(iter(recording.tables[0].rows(["q.2", "log.on"], "t")))
    assert rows.values[3].tolist() == [7.0, 1.0]


def test_npy_is_mapped_and_read_by_position(tmp_path: Path) -> None:
    table = np.column_stack([np.arange(5) / 10, np.arange(5.0)])
    np.save(tmp_path / "run.npy", table)
    source = Recorded("run", (tmp_path / "run.npy",), (Cell("x", 1, "m"),), Clock(0))
    assert next(source.read()).v[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_npy_dates_text_and_complex(tmp_path: Path) -> None:
    days = np.array(["2021-03-04", "2021-03-05"], dtype="datetime64[D]")
    np.savez(tmp_path / "a.npz", when=days, x=np.ones(2), z=np.ones(2) * 1j, s=np.array(["a", "b"]))
    recording = open_recording(tmp_path / "a.npz")
    assert [c.kind for c in recording.tables[0].columns] == ["time", "number", "text"]
    assert recording.notes == ("z: complex128 of shape (2,) is no column",)
    chunk = next(Recorded("run", (tmp_path / "a.npz",), (Cell("x", "x", "1"),)).read())
    assert chunk.t.tolist() == days.astype("datetime64[ns]").astype(np.int64).tolist()
    with pytest.raises(DataError, match="expected numbers"):
        next(Recorded("run", (tmp_path / "a.npz",), (Cell("x", "s", "1"),)).read())


def test_parquet_types(tmp_path: Path) -> None:
    table = pa.table(
        {
            "when": pa.array([0, 1, None, 3], pa.timestamp("ms", "UTC")),
            "on": pa.array([True, None, False, True]),
            "d": pa.array(["a", "b", "a", "b"]).dictionary_encode(),
            "n": pa.array([1, None, 2**53 + 1, 4]),
            "list": [[1.0], [2.0], [], [3.0]],
        }
    )
    pq.write_table(table, tmp_path / "run.parquet", row_group_size=2)
    recording = open_recording(tmp_path / "run.parquet")
    assert [c.kind for c in recording.tables[0].columns] == ["time", "boolean", "text", "number"]
    assert recording.notes == ("list: nested columns",)
    source = Recorded("run", (tmp_path / "run.parquet",), (Cell("on", "on", "1"),))
    v = np.concatenate([c.v for c in source.read()])[:, 0]
    assert v.tolist()[::2] == [1.0, 1.0] and np.isnan(v[1])
    assert source.tally.counts == {"no_stamp": 1}


def test_parquet_integer_stamps_with_a_hole_stay_exact(tmp_path: Path) -> None:
    t = 1_614_859_007_119_846_000
    table = pa.table({"t": pa.array([t + 1, None, t + 3, t + 4, t + 5]), "x": [1.0] * 5})
    pq.write_table(table, tmp_path / "run.parquet")
    chunk = next(Recorded("run", (tmp_path / "run.parquet",), (Cell("x", "x", "1"),)).read())
    assert (chunk.t - t).tolist() == [1, 3, 4, 5]


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from([b",", b";", b"\t", b"|", b" "]),
    st.sampled_from([b".", b","]),
    st.booleans(),
    st.sampled_from([b"\n", b"\r\n"]),
    st.integers(0, 10**6),
)
def test_text_dialects(
    tmp_path_factory: pytest.TempPathFactory,
    delimiter: bytes, decimal: bytes, headed: bool, end: bytes, seed: int,
) -> None:  # fmt: skip
    if delimiter == decimal:
        return
    rng = np.random.default_rng(seed)
    table = np.round(rng.normal(size=(40, 3)), 4)
    table[:, 0] = np.arange(40) / 10
    rows = [
        delimiter.join(f"{v:.4f}".encode().replace(b".", decimal) for v in row) for row in table
    ]
    if headed:
        rows.insert(0, delimiter.join([b"t", b"x", b"y"]))
    path = tmp_path_factory.mktemp("d") / "run.csv"
    path.write_bytes(end.join(rows) + end)
    cells = (Cell("x", 1, "1"), Cell("y", 2, "1"))
    chunk = next(Recorded("run", (path,), cells).read())
    assert (chunk.v == table[:, 1:]).all()


@pytest.mark.parametrize(
    "above",
    [
        "Anlage 3;;;\n\nExport vom 03.05.2024 14:00;;;\n",
        "Recorder V2\nSerial number;4711\nOperator;\n",
        "Title of a run;;;\n" * 40,
    ],
)
def test_lines_above_the_headings_are_titles(tmp_path: Path, above: str) -> None:
    rows = "".join(f"{i / 10:.1f};{i};{-i};0,5\n".replace(".", ",") for i in range(60))
    path = tmp_path / "export.csv"
    path.write_text(f"{above}Time;Speed;Torque;Load\ns;rad/s;Nm;kg\n{rows}")
    assert open_recording(path).tables[0].columns[1].unit == "rad/s"
    cells = (Cell("w", "Speed", "rad/s"), Cell("m", "Load", "kg"))
    v = np.concatenate([c.v for c in Recorded("run", (path,), cells).read()])
    assert v.tolist() == [[float(i), 0.5] for i in range(60)]


def test_a_first_row_with_holes_is_no_title(tmp_path: Path) -> None:
    path = tmp_path / "holes.csv"
    path.write_text(";;;7\n" + "".join(f"{i};{i};{-i};8\n" for i in range(1, 60)))
    source = Recorded("run", (path,), (Cell("m", 3, "kg"),), clock=Clock(rate=10.0))
    v = np.concatenate([c.v for c in source.read()])[:, 0]
    assert v.tolist() == [7.0] + [8.0] * 59


def test_blocks_of_any_size_give_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{i / 10},{i},{-i}" for i in range(300)]
    rows[100], rows[200] = "10.0,7", "20.0,1,2,3"
    path.write_text("# note\nt,x,y\n\n" + "\r\n".join(rows) + "\n")
    cells = (Cell("x", "x", "1"),)
    whole = Recorded("run", (path,), cells)
    expected = np.concatenate([c.v for c in whole.read()])
    for size in (1, 7, 64, 1000):
        monkeypatch.setattr("evertwin.sources.texts.text.BLOCK", size)
        cut = Recorded("run", (path,), cells)
        assert (np.concatenate([c.v for c in cut.read()]) == expected).all()
        assert cut.tally == whole.tally
    assert whole.tally.counts == {"truncated": 1, "overlong": 1}
    assert whole.tally.first["truncated"][0].line == 104


def test_missing_extra_says_what_to_install() -> None:
    with pytest.raises(MissingExtra, match=r"pip install 'evertwin\[formats\]'"):
        load("no_such_library_at_all.part")


def test_a_folder_without_a_bag(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="ROS 2 bag"):
        open_recording(tmp_path)
    with pytest.raises(DataError, match="No such file"):
        open_recording(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("first", "said"),
    [
        ("[Content_Types].xml", "an Excel workbook: save the sheet as CSV"),
        ("_rels/.rels", "an Excel workbook: save the sheet as CSV"),
        ("mimetype", "an OpenDocument file"),
        ("run.csv", "a zip archive: unpack it first"),
    ],
)
def test_an_archive_is_called_by_what_is_in_it(tmp_path: Path, first: str, said: str) -> None:
    file = tmp_path / "own.xlsx"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(first, "<xml/>")
    with pytest.raises(DataError, match=re.escape(said)):
        open_recording(file)


def test_a_workbook_is_no_small_table_either(tmp_path: Path) -> None:
    file = tmp_path / "own.xlsx"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("[Content_Types].xml", "<xml/>" * 500)
        archive.writestr("xl/sheet.bin", bytes(range(256)) * 20)
    with pytest.raises(DataError, match="an Excel workbook: save the sheet as CSV"):
        read_table(file)
