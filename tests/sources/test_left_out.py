"""Every row that is read and not used is counted, and what is probably wrong is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.sources import Cell, Clock, Recorded, Tally, inspect, render

N = 401


def source(path: Path, stamps: list[str], unit: str = "s", head: str = "t") -> Recorded:
    rows = [f"{t},{i}" for i, t in enumerate(stamps)]
    (path / "run.csv").write_text("\n".join([f"{head},x [m]", *rows]) + "\n")
    clock = Clock(0, unit)
    return Recorded("log", (path / "run.csv",), (Cell("x", 1, "m"),), clock, tally=Tally("log"))


def read(recorded: Recorded) -> Tally:
    used = sum(len(chunk.t) for chunk in recorded.read())
    assert recorded.tally.used == used
    assert recorded.tally.left_out + used == N
    return recorded.tally


def test_nothing_is_said_of_a_sound_recording(tmp_path: Path) -> None:
    tally = read(source(tmp_path, [f"{i / 10:.1f}" for i in range(N)]))
    assert str(tally) == "" and not tally.finding and tally.share == 0.0


def test_a_recording_written_backward(tmp_path: Path) -> None:
    tally = read(source(tmp_path, [f"{(N - i) / 10:.1f}" for i in range(N)]))
    assert tally.finding and tally.counts == {"backward": 400}
    assert str(tally).startswith(
        "log: 400 of 401 rows left out (99.8 %): 400 backward, run.csv line 2"
    )
    assert tally.suspicions == ["the stamps fall in 400 of 400 steps: sort the rows by time"]


def test_stamps_rounded_to_seconds(tmp_path: Path) -> None:
    tally = read(source(tmp_path, [str(i // 20) for i in range(N)]))
    assert tally.counts == {"repeated": 380}
    assert "380 of 400 stamps repeat the one before" in tally.suspicions[0]


UNITS = {  # unit read → the stamps are in truth in, as text from seconds
    ("s", "ns"): ("t", lambda s: str(round(s * 1e9)), "10^9 times too long"),
    ("s", "us"): ("t", lambda s: f"{1_614_859_007_000_000 + 1e6 * s:.0f}", "10^6 times too long"),
    ("ms", "us"): ("stamp_us", lambda s: str(round(s * 1e6)), "10^3 times too long"),
    ("s", "ms"): ("t [ms]", lambda s: f"{1e3 * s:.3f}", "10^3 times too long"),
    ("ms", "s"): ("t [s]", lambda s: f"{s:.3f}", "10^3 times too short"),
}  # fmt: skip


@pytest.mark.parametrize("pair", UNITS)
def test_another_unit_of_time_is_named_with_its_factor(
    tmp_path: Path, pair: tuple[str, str]
) -> None:
    head, text, said = UNITS[pair]
    tally = read(source(tmp_path, [text(i / 20) for i in range(N)], pair[0], head))
    (suspicion,) = tally.suspicions
    assert tally.finding and said in suspicion and f"unit = '{pair[1]}'" in suspicion


def test_a_unit_that_the_file_cannot_tell_is_believed(tmp_path: Path) -> None:
    tally = read(source(tmp_path, [f"{0.05 * i:.2f}" for i in range(N)], "ms"))
    assert not tally.finding  # 20 kHz


@pytest.mark.parametrize(("unit", "scale", "said"), [
    ("m", 1.0, ""), ("mm", 1.0, "x: the file says 'm', the twin file 'mm': a factor of 1000"),
    ("mm", 1000.0, ""), ("V", 1.0, ""),
])  # fmt: skip
def test_another_unit_of_a_channel(tmp_path: Path, unit: str, scale: float, said: str) -> None:
    plain = source(tmp_path, [f"{i / 10:.1f}" for i in range(N)])
    tally = Tally("log")
    list(Recorded("log", plain.files, (Cell("x", 1, unit, scale),), tally=tally).read())
    assert tally.suspicions == ([said] if said else [])


def test_absurd_values_are_counted_by_row_and_sentinels_are_not(tmp_path: Path) -> None:
    rows = [f"{i / 10},{i},{-i}" for i in range(N)]
    for i, word in ((7, "inf,-inf"), (9, "1e300,1"), (11, "-9999,1"), (13, ",2")):
        rows[i] = f"{i / 10},{word}"
    (tmp_path / "run.csv").write_text("\n".join(["t,x,y", *rows]) + "\n")
    tally = Tally("log")
    cells = (Cell("x", "x", "m", sentinels=(-9999.0,)), Cell("y", "y", "m"))
    (chunk,) = Recorded("log", (tmp_path / "run.csv",), cells, tally=tally).read()
    assert np.isinf(chunk.v[11, 0]) and tally.counts == {"absurd": 2, "empty": 1}
    assert (tally.left_out, tally.used) == (2, N - 2) and not tally.finding
    assert tally.lines()[0] == "2 absurd, run.csv line 9: x: inf"


def test_more_than_a_share_is_a_finding(tmp_path: Path) -> None:
    for bad, found in ((4, False), (5, True)):
        stamps = [f"{i / 10:.1f}" for i in range(N)]
        for i in range(bad):
            stamps[50 * i + 20] = ""
        tally = read(source(tmp_path, stamps))
        assert tally.left_out == bad and tally.finding is found
    assert not Tally("log", 0.05, 100, {"repeated": 5}).finding


def test_info_counts_what_a_twin_would_leave_out(tmp_path: Path) -> None:
    recorded = source(tmp_path, [f"{(N - i) / 10:.1f}" for i in range(N)])
    info = inspect(recorded.files[0])
    (table,) = info.tables
    assert (table.left_out, table.used) == (400, 1)
    assert "400 of 401 rows are left out (99.8 %)" in render(info)
    assert any("sort the rows by time" in line for line in info.findings)
