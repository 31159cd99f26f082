"""Planted faults are found, counted and placed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from evertwin.sources import inspect, render
from evertwin.sources.columns.statistics import ClockStatistics, ColumnStatistics, EvenSample

RNG = np.random.default_rng(5)
N = 3000


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """100 Hz with jitter and one fault of every kind, planted at known lines."""
    t = np.arange(N) * 0.01 + RNG.uniform(0, 0.002, N)
    t[1000:] += 3.0
    t[1500], t[2000] = t[1499], t[1900]
    x = np.sin(t) + 0.01 * RNG.normal(size=N)
    x[700:900] = x[700]
    x[100], x[200] = 1e9, -9999.0
    rows = [f"{a:.6f},{b!r},{int(i % 50 < 25)}" for i, (a, b) in enumerate(zip(t, x.tolist()))]
    rows[300], rows[301] = rows[300].replace(f"{x[300].item()!r}", "nan"), "3.01,0.1"
    rows[302] = rows[302].replace(f"{x[302].item()!r}", "inf")
    rows[303] = rows[303].replace(f"{x[303].item()!r}", "ERR")
    path = tmp_path_factory.mktemp("info") / "run.csv"
    path.write_text("\n".join(["time [s],angle [rad],on", *rows]) + "\n")
    return path


def test_planted_faults_are_found(spoilt: Path) -> None:
    info = inspect(spoilt)
    (table,) = info.tables
    angle = table.columns[1]
    time = table.time
    assert time is not None
    lost = {"truncated": 1, "repeated": 1, "backward": 1}
    assert table.rows == N - 1 and table.problems == {**lost, "text": 1, "gap": 1}
    assert (table.left_out, table.used) == (3, N - 3)
    assert (angle.missing, angle.infinite, angle.text) == (2, 1, 1)
    assert (1e9, 102) in angle.absurd and angle.sentinels == (-9999.0,)
    assert angle.constant_rows == 200 and angle.constant_line == 702
    assert (time.repeated, time.backward) == (1, 1)
    assert time.gaps >= 1 and time.longest_gap_line == 1002 and 2.9 < time.longest_gap < 3.1
    assert abs(time.rate - 100) < 3 and 0 < time.jitter < 0.002
    text = " ".join(info.findings)
    for word in ("truncated", "absurd", "gap", "repeated", "back", "frozen", "infinite", "empty"):
        assert word in text


def test_as_text_and_as_json(spoilt: Path) -> None:
    info = inspect(spoilt)
    text = render(info)
    assert "angle" in text and "findings" in text and "line 303" in text
    content = json.loads(json.dumps(info.to_dict(), allow_nan=False))
    assert content["schema"] == "evertwin.info/1"
    assert content["tables"][0]["time"]["rate"] == pytest.approx(100, abs=3)


def test_pieces_do_not_change_the_statistics(monkeypatch: pytest.MonkeyPatch, spoilt: Path) -> None:
    whole = inspect(spoilt)
    monkeypatch.setattr("evertwin.sources.texts.text.BLOCK", 3000)
    cut = inspect(spoilt)
    a, b = whole.tables[0], cut.tables[0]
    assert a.time == b.time and a.problems == b.problems
    for one, two in zip(a.columns, b.columns, strict=True):
        assert (one.count, one.low, one.high, one.constant_rows, one.changes) == (
            two.count, two.low, two.high, two.constant_rows, two.changes,
        )  # fmt: skip
        np.testing.assert_allclose([one.mean, one.std], [two.mean, two.std], rtol=1e-12)


def test_statistics_against_numpy() -> None:
    v = RNG.normal(size=5000) * 3 + 1e6
    stats, line = ColumnStatistics(), np.arange(5000)
    for part, at in zip(np.array_split(v, 7), np.array_split(line, 7), strict=True):
        stats.add(at, part)
    np.testing.assert_allclose([stats.mean, stats.std], [v.mean(), v.std()], rtol=1e-9)
    assert (stats.lows[0][0], stats.highs[0][0]) == (v.min(), v.max())
    assert np.isnan(ColumnStatistics().mean) and np.isnan(ColumnStatistics().std)
    assert ColumnStatistics().absurd() == []


def test_an_even_sample_stays_small() -> None:
    sample = EvenSample(100)
    for part in np.array_split(np.arange(10_000.0), 13):
        sample.add(part)
    assert len(sample.values) <= 100
    assert (np.diff(sample.values) == sample.every).all()


def test_clock_without_rows() -> None:
    clock = ClockStatistics()
    clock.add(np.zeros(0, np.int64), np.zeros(0, np.int64))
    assert clock.rows == 0


def test_info_of_a_table_without_time(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("kind,x\n" + "".join(f"a,{i % 3}\n" for i in range(9)))
    info = inspect(path)
    assert info.tables[0].time is None
    assert any("no column of time" in finding for finding in info.findings)
    assert "constant" not in " ".join(info.findings)


def test_info_of_dates_with_words_and_constant(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"2021-03-04T12:00:{i:02d}Z,5" for i in range(30)]
    rows[7] = "later,5"
    path.write_text("when,x\n" + "\n".join(rows) + "\n")
    info = inspect(path)
    time = info.tables[0].time
    assert time is not None and time.unit == "iso" and time.no_stamp == 1
    assert "x: constant at 5" in info.findings
    assert "2021-03-04T12:00:00.000000Z" in render(info)


def test_info_asks_for_an_unclear_unit(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,x\n" + "".join(f"{20 * i},{i}\n" for i in range(30)))
    assert any("not clear" in finding for finding in inspect(path).findings)
