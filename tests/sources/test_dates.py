"""Dates of loggers and spreadsheets: read where they can be read in one way only."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.sources.columns.cells import Cell
from evertwin.sources.info import inspect
from evertwin.sources.recorded import Clock, Recorded

FIRST = datetime(2025, 1, 13, 8, 59, 58)
SECOND = 10**9


def written(folder: Path, form: str, start: datetime = FIRST, step: float = 1.0) -> Path:
    """A table of 40 rows whose stamps are written so."""
    rows = [
        f"{(start + timedelta(seconds=step * k)).strftime(form)};{k}\n" for k in range(40)
    ]  # fmt: skip
    file = folder / "log.csv"
    file.write_text("Zeit;v\n" + "".join(rows))
    return file


def read(file: Path, unit: str = "auto") -> np.ndarray:
    """The stamps of a recording [ns]."""
    chunks = Recorded("log", (file,), (Cell("v", "v", "1"),), Clock("Zeit", unit)).read()
    return np.concatenate([chunk.t for chunk in chunks])


@pytest.mark.parametrize("unit", ["auto", "iso"])
@pytest.mark.parametrize(
    ("form", "zone"),
    [
        ("%d.%m.%Y %H:%M:%S", 0),
        ("%d/%m/%Y %H:%M:%S", 0),
        ("%d-%m-%Y %H:%M:%S", 0),
        ("%m/%d/%Y %I:%M:%S %p", 0),
        ("%m/%d/%Y, %I:%M:%S %p", 0),
        ("%d.%m.%y %H:%M:%S", 0),
        ("%d-%b-%Y %H:%M:%S", 0),
        ("%Y/%m/%d %H:%M:%S", 0),
        ("%d.%m.%Y %H:%M:%S,000", 0),
        ("%Y-%m-%d %H:%M:%S CET", 1),
        ("%d.%m.%Y %H:%M:%S +0100", 1),
        ("%Y-%m-%dT%H:%M:%S+01:00[Europe/Berlin]", 1),
    ],
)
def test_a_date_that_can_be_read_in_one_way(
    tmp_path: Path, form: str, zone: int, unit: str
) -> None:
    first = int(np.datetime64(FIRST, "ns").astype(np.int64)) - zone * 3600 * SECOND
    file = written(tmp_path, form)
    assert read(file, unit).tolist() == [first + k * SECOND for k in range(40)]
    time = inspect(file).tables[0].time
    assert time is not None and time.start == first and not inspect(file).findings


def test_days_and_minutes(tmp_path: Path) -> None:
    assert set(np.diff(read(written(tmp_path, "%Y/%m/%d", step=86_400)))) == {86_400 * SECOND}
    assert set(np.diff(read(written(tmp_path, "%d/%m/%Y %H:%M", step=60)))) == {60 * SECOND}


@pytest.mark.parametrize("form", ["%d.%m.%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S"])
def test_a_date_that_can_be_read_in_two_ways_is_asked_for(tmp_path: Path, form: str) -> None:
    file = written(tmp_path, form, datetime(2025, 4, 3, 8))
    with pytest.raises(DataError, match=r'day from month.*set time = { unit = "dmy" or "mdy" }'):
        read(file)
    day, month = read(file, "dmy")[0], read(file, "mdy")[0]
    assert abs(day - month) == 30 * 86_400 * SECOND  # 3 April, 4 March


def test_a_later_row_tells_the_day(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    days = [datetime(2025, 1, 5) + timedelta(hours=k / 100) for k in range(30_000)]
    file.write_text("Zeit;v\n" + "".join(f"{d:%d/%m/%Y %H:%M:%S};1\n" for d in days))
    assert set(np.diff(read(file))) == {36 * SECOND}


def test_times_of_day_go_on_over_midnight(tmp_path: Path) -> None:
    file = written(tmp_path, "%H:%M:%S", datetime(2025, 4, 3, 23, 59, 50))
    assert set(np.diff(read(file))) == {SECOND}
    assert not inspect(file).findings
    half = written(tmp_path, "%I:%M:%S %p", datetime(2025, 4, 3, 12, 59, 50))
    assert set(np.diff(read(half))) == {SECOND}


def test_a_date_beside_a_time_of_day(tmp_path: Path) -> None:
    """The column that tells rows apart is the time."""
    file = tmp_path / "log.csv"
    rows = [f"13.01.2025;08:00:{k};1\n" for k in range(20, 60)]
    file.write_text("Datum;Uhrzeit;v\n" + "".join(rows))
    time = inspect(file).tables[0].time
    assert time is not None and (time.column, time.unit, time.duration) == ("Uhrzeit", "clock", 39)
    days = [f"{k // 4 + 10}.01.2025;{6 * (k % 4):02}:30;1\n" for k in range(40)]
    file.write_text("Datum;Uhrzeit;v\n" + "".join(days))  # of several days both do
    time = inspect(file).tables[0].time
    assert time is not None and (time.column, time.unit) == ("Datum", "dmy")
    assert (time.duration, time.period) == (39 * 21600, 21600)
    file.write_text("Uhrzeit;t;v\n" + "".join(f"08:00:{k};{k / 10};1\n" for k in range(20, 60)))
    time = inspect(file).tables[0].time
    assert time is not None and time.column == "t"


@pytest.mark.parametrize(
    ("form", "reason"),
    [
        ("%H:%M", "hours and minutes, or minutes and seconds"),
        ("%Y-%m-%d %H:%M:%S PST", r"a zone is Z, UTC.*\+01:00"),
        ("31.02.2025 %H:%M:%S", "no such day"),
        ("13.01.2025 %H:%M:%S pm", None),
        ("13.01.2025 17:%M:%S pm", "hours from 1 to 12"),
        ("13.01.2025 8:61:%S", "no such time of day"),
    ],
)
def test_what_is_no_stamp_says_why(tmp_path: Path, form: str, reason: str | None) -> None:
    file = written(tmp_path, form)
    if reason is None:
        assert len(read(file)) == 40
        return
    with pytest.raises(DataError, match=rf"log.csv:2: column 'Zeit'.*{reason}"):
        read(file)
    assert any("line 2: expected a stamp" in line for line in inspect(file).findings)


def test_dates_that_are_read_as_seconds_name_their_unit(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"set time = { unit = 'dmy' }"):
        read(written(tmp_path, "%d.%m.%Y %H:%M:%S"), "s")


def test_shuffled_rows_are_named(tmp_path: Path) -> None:
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(400)
        file = tmp_path / f"{seed}.csv"
        file.write_text("t,v\n" + "".join(f"{k},1\n" for k in order))
        source = Recorded("log", (file,), (Cell("v", "v", "1"),), Clock("t", "s"))
        list(source.read())
        assert source.tally.suspicions[0].startswith("the stamps fall in ")
        assert source.tally.suspicions[0].endswith(" of 399 steps: sort the rows by time")
        time = inspect(file).tables[0].time
        assert time is not None and time.unit == "s"
