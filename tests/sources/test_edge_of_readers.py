"""What a stranger's file may hold where nobody looks: headers, topics, headings, sizes."""

from __future__ import annotations

import io
import sqlite3
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from evertwin.errors import DataError
from evertwin.sources import Cell, Recorded, inspect, open_recording
from evertwin.sources.numeric import arrays
from evertwin.sources.robot_logs.bag_files import Cut, messages


def npy(header: str, data: bytes = b"\0" * 800) -> bytes:
    text = header.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data


HEADERS = [
    "((((((", "'''", "(" * 900, "-" * 9000 + "1", "\0", "[" * 200 + "]" * 200, "9" * 5000, "",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (9**9**9,)}",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "9" * 4000 + ",)}",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 50000000)}",
    "{'descr': '|O', 'fortran_order': False, 'shape': (100,)}",
    "{'descr': '<M8[Q]', 'fortran_order': False, 'shape': (100,)}",
]  # fmt: skip


@pytest.mark.parametrize("header", HEADERS)
@pytest.mark.parametrize("kind", ["npy", "npz"])
def test_a_header_of_numpy_is_one_sentence(tmp_path: Path, header: str, kind: str) -> None:
    raw = npy(header)
    if kind == "npz":
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            archive.writestr("x.npy", raw)
        raw = packed.getvalue()
    path = tmp_path / f"a.{kind}"
    path.write_bytes(raw)
    with pytest.raises(DataError, match=rf"^a\.{kind}: ") as error:
        open_recording(path)
    assert "\n" not in str(error.value) and len(str(error.value)) < 400
    assert "0x" not in str(error.value)


def matrix(kind: int, *parts: bytes) -> bytes:
    def element(code: int, data: bytes) -> bytes:
        return struct.pack("<II", code, len(data)) + data + b"\0" * (-len(data) % 8)

    flags = element(6, struct.pack("<II", kind, 0))
    return element(14, flags + b"".join(element(1, part) for part in parts))


def test_an_object_in_a_mat_file_is_left_out_by_name(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"t": np.arange(50.0), "x": 2 * np.arange(50.0)})
    plain = buffer.getvalue()
    path = tmp_path / "a.mat"
    path.write_bytes(plain[:128] + matrix(17, b"note", b"MCOS", b"string") + plain[128:])
    recording = open_recording(path)
    assert [c.name for c in recording.tables[0].columns] == ["t", "x"]
    assert recording.notes == ("note: opaque is no number",)


def test_a_mat_file_that_unpacks_to_far_more_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arrays, "CALM", 1 << 20)
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"x": np.zeros(200_000)}, do_compression=True)
    path = tmp_path / "a.mat"
    path.write_bytes(buffer.getvalue())
    with pytest.raises(DataError, match="unpack to 1600048"):
        open_recording(path)


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_headings_of_a_spreadsheet(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.csv"
    rows = "".join(f"{i / 10};{i}\n" for i in range(30))
    path.write_bytes(("Zeit [s];Weg\xa0rückwärts [µm]\n" + rows).encode(encoding))
    columns = open_recording(path).tables[0].columns
    assert [(c.name, c.unit) for c in columns] == [("Zeit", "s"), ("Weg rückwärts", "µm")]
    cells = (Cell("x", "Weg rückwärts", "µm"),)
    (chunk,) = Recorded("run", (path,), cells).read()
    assert chunk.v[3, 0] == pytest.approx(3e-6)


def test_headings_in_no_known_encoding_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"t,\x81\x8d\n0,1\n1,2\n")
    with pytest.raises(DataError, match="neither UTF-8 nor Windows-1252"):
        open_recording(tmp_path / "a.csv")


HEADED = {
    "name, unit, short name": ["Time;Speed of motor 1", "ms;rad/s", "t;m1vel"],
    "name, short name, unit": ["Time;Speed of motor 1", "t;m1vel", "[ms];[rad/s]"],
    "with a unit nobody knows": ["Time;Speed of motor 1", "ms;ticks", "t;m1vel"],
}


@pytest.mark.parametrize("name", HEADED)
def test_three_heading_lines(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{20 * i}.5;{i};" for i in range(30)]
    path.write_text("\n".join([*(f"{line};" for line in HEADED[name]), *rows]) + "\n")
    table = open_recording(path).tables[0]
    assert [c.name for c in table.columns] == ["Time", "Speed of motor 1"]
    assert [c.unit for c in table.columns] == ["ms", "ticks" if "nobody" in name else "rad/s"]
    assert [c.also for c in table.columns] == [("t",), ("m1vel",)]
    time = inspect(path).tables[0].time
    assert time is not None and (time.column, time.unit) == ("Time", "ms")
    long, short = (
        next(Recorded("run", (path,), (Cell("v", column, "rad/s"),)).read())
        for column in ("Speed of motor 1", "m1vel")
    )
    assert long.t.tolist() == short.t.tolist() and long.t[2] == 40_500_000
    assert long.v.tolist() == short.v.tolist() and long.v[2, 0] == 2.0


def test_a_table_of_words_has_one_heading_line(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("who,what\n" + "me,this\n" * 30)
    assert inspect(path).tables[0].rows == 30


@pytest.mark.parametrize(
    ("heading", "said"),
    [
        ("9^999999999", "not known"),
        ("m/0", "not known"),
        ("dBm", "logarithmic"),
        ("m" * 300, "not"),
    ],
)
def test_a_unit_in_a_heading_is_a_finding(tmp_path: Path, heading: str, said: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"t,x [{heading}]\n" + "".join(f"{i / 10},{i}\n" for i in range(30)))
    (finding,) = [line for line in inspect(path).findings if "unit" in line]
    assert finding.startswith("x: its unit '") and said in finding and len(finding) < 250


SHAPES = {
    "wide": ("t," + ",".join(f"x{i}" for i in range(5000)) + "\n" + "1," * 5000 + "1\n", "columns"),
    "long name": (f"t,{'x' * 300}\n0,1\n1,2\n", "up to 200 signs"),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_table_that_nobody_can_read_is_refused(tmp_path: Path, name: str) -> None:
    content, said = SHAPES[name]
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(DataError, match=said):
        inspect(tmp_path / "a.csv")


def test_a_cell_too_long_for_a_stamp_costs_no_memory(tmp_path: Path) -> None:
    rows = [f"{i / 10},{i}" for i in range(50_000)]
    rows[700] = "1" * 900_000 + ",700"
    (tmp_path / "a.csv").write_text("t,x\n" + "\n".join(rows) + "\n")
    with pytest.raises(DataError, match=r"a\.csv:702: column 't': expected a stamp"):
        list(Recorded("run", (tmp_path / "a.csv",), (Cell("x", "x", "1"),)).read())


def rosout_bag(path: Path) -> Path:
    store = get_typestore(Stores.ROS2_HUMBLE)
    time, log = store.types["builtin_interfaces/msg/Time"], store.types["rcl_interfaces/msg/Log"]
    with Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        link = writer.add_connection("/rosout", "rcl_interfaces/msg/Log", typestore=store)
        for i in range(40):
            stamp = 1_614_859_007 * 10**9 + i * 20_000_000
            said = log(
                stamp=time(sec=stamp // 10**9, nanosec=stamp % 10**9), level=20, name="drive",
                msg="hello", file="drive.cpp", function="main", line=i,
            )  # fmt: skip
            writer.write(link, stamp, store.serialize_cdr(said, "rcl_interfaces/msg/Log"))
    return path


def test_a_bag_with_the_log_of_ros_is_described(tmp_path: Path) -> None:
    table = inspect(rosout_bag(tmp_path / "bag")).tables[0]
    assert table.name == "/rosout" and table.rows == 40
    cells = (Cell("line", "/rosout.line", "1"),)
    (chunk,) = Recorded("log", (tmp_path / "bag",), cells).read()
    assert chunk.v[:, 0].tolist() == list(range(40))


TOPICS = "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT, serialization_format TEXT)"
ENDLESS = (
    "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
    "SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM n"
)
HUGE = "INSERT INTO messages VALUES (1, 1, 5, 1000000000000)"
MESSAGES = "CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)"


@pytest.mark.parametrize(
    ("statements", "said"),
    [((TOPICS, ENDLESS), "expected tables"), ((TOPICS, MESSAGES, HUGE), "a message of int")],
)
def test_a_database_that_does_more_than_hold_rows(
    tmp_path: Path, statements: tuple[str, ...], said: str
) -> None:
    path = tmp_path / "a.db3"
    link = sqlite3.connect(path)
    for statement in (*statements, "INSERT INTO topics VALUES (1, '/x', 'a/msg/B', 'cdr')"):
        link.execute(statement)
    link.commit()
    link.close()
    try:
        (cut,) = messages(path, "db3")
        assert isinstance(cut, Cut) and said in cut.reason
    except DataError as error:
        assert said in str(error)
