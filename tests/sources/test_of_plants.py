"""Exports of plants: status words, units below headings, tags row by row, clocks of all kinds."""

from __future__ import annotations

import datetime
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from evertwin.sources import TableInfo, inspect

N = 200
BEGIN = datetime.datetime(2026, 3, 14, 6)
U, Y = np.random.default_rng(5).uniform(0.0, 100.0, (2, N)).round(2).tolist()


def written(folder: Path, lines: Iterable[str], encoding: str = "utf-8") -> Path:
    file = folder / "log.csv"
    file.write_text("\n".join((*lines, "")), encoding=encoding)
    return file


def table_of(folder: Path, head: str, rows: Iterable[str]) -> TableInfo:
    return inspect(written(folder, (head, *rows))).tables[0]


def stamp(k: int, how: str = "%d.%m.%Y %H:%M:%S") -> str:
    return f"{BEGIN + datetime.timedelta(seconds=5 * k):{how}}"


def test_words_beside_dates_do_not_hide_what_parts_the_cells(tmp_path: Path) -> None:
    """Each row held a date, a time of day behind a blank, and words: it was cut at that blank."""
    head = ("Zeitstempel;Füllstand B3;Zulauf F12;Betriebsart", "TT.MM.JJJJ hh:mm:ss;m;m³/h;-")
    rows = (f"{stamp(k)};{1000 + k},25;12,{k % 10};AUTO" for k in range(N))
    table = inspect(written(tmp_path, (*head, *rows), "cp1252")).tables[0]
    assert table.time is not None and table.time.unit == "dmy" and table.rows == N
    assert [c.unit for c in table.columns[1:3]] == ["m", "m³/h"]
    assert table.columns[1].high == 1000.25 + N - 1


@pytest.mark.parametrize(("name", "factor", "unit"), [("epoch", 1, "s"), ("unix", 1000, "ms")])
def test_seconds_since_1970_are_time_wherever_they_stand(
    name: str, factor: int, unit: str, tmp_path: Path
) -> None:
    rows = (f"{U[k]},{Y[k]},{(1_760_000_000 + k) * factor}" for k in range(N))
    time = table_of(tmp_path, f"valve,level,{name}", rows).time
    assert time is not None
    assert (time.column, time.unit, time.rate) == (name, unit, pytest.approx(1.0))


@pytest.mark.parametrize("name", ["Sample", "k", "window", "cycle", "epoch", ""])
def test_what_counts_the_rows_is_no_time(name: str, tmp_path: Path) -> None:
    rows = (f"{k + 1},{U[k]},{Y[k]}" for k in range(N))
    file = written(tmp_path, (f"{name},u,y", *rows))
    info = inspect(file)
    assert info.tables[0].time is None
    assert "counts the rows, no column of time was found" in info.findings[0]


def test_a_time_that_advances_by_a_second_a_row_is_one(tmp_path: Path) -> None:
    for head, first in (("time,u,y", 0), ("a,u,y", 1_760_000_000)):
        rows = (f"{first + k},{U[k]},{Y[k]}" for k in range(N))
        time = table_of(tmp_path, head, rows).time
        assert time is not None and time.rate == pytest.approx(1.0)


def test_a_row_for_each_tag_is_told_and_what_to_do(tmp_path: Path) -> None:
    rows = (
        f"{tag};{stamp(k)};{value};Good"
        for k in range(N) for tag, value in (("LT1", f"1,{k}"), ("FT2", f"7,{k}"))
    )  # fmt: skip
    info = inspect(written(tmp_path, ("Tag;Zeit;Wert;Status", *rows)))
    (said,) = (one for one in info.findings if "each row is of one signal" in one)
    assert "LT1; FT2, named in 'Tag'" in said
    assert "pivot(index='Zeit', columns='Tag', values='Wert')" in said


def test_stamps_that_are_rounded_are_no_tags(tmp_path: Path) -> None:
    rows = (f"{stamp(k // 4)};{U[k]};{'Good' if k % 9 else 'Bad'}" for k in range(N))
    info = inspect(written(tmp_path, ("Zeit;Wert;Status", *rows)))
    assert not any("each row is of one signal" in one for one in info.findings)
    assert any("they are rounded" in one for one in info.findings)


def test_a_month_by_name_before_a_year_of_two_digits(tmp_path: Path) -> None:
    rows = (f"{stamp(k, '%d-%b-%y %H:%M:%S')},{U[k]},{Y[k]}" for k in range(N))
    time = table_of(tmp_path, "Timestamp,FIC101.OUT,LT101.PV", rows).time
    assert time is not None and time.unit == "iso"
    assert time.start == int(BEGIN.replace(tzinfo=datetime.UTC).timestamp()) * 10**9


@pytest.mark.parametrize(("off", "on"), [("AUS", "EIN"), ("off", "On"), ("Closed", "Open")])
def test_a_column_of_switch_words_is_one_of_numbers(off: str, on: str, tmp_path: Path) -> None:
    rows = (f"{stamp(k)};{on if U[k] > 50 else off};{k}" for k in range(N))
    table = table_of(tmp_path, "Zeit;Pumpe;Pegel", rows)
    pump = table.columns[1]
    assert (pump.kind, pump.low, pump.high, pump.missing) == ("boolean", 0.0, 1.0, 0)
    assert pump.mean == pytest.approx(np.mean(np.array(U) > 50))


def test_off_among_numbers_is_no_zero(tmp_path: Path) -> None:
    rows = (f"{stamp(k)};{'off' if k % 9 == 5 else 20 + k};{Y[k]}" for k in range(N))
    column = table_of(tmp_path, "Zeit;Drehzahl;Pegel", rows).columns[1]
    assert column.low == 20.0 and column.missing == sum(k % 9 == 5 for k in range(N))


def test_days_of_a_spreadsheet_are_asked(tmp_path: Path) -> None:
    rows = (f"{46095.25 + 10 * k / 86400:.8f};{U[k]};{Y[k]}" for k in range(N))
    time = table_of(tmp_path, "Time;Valve;Level", rows).time
    assert time is not None and not time.sure and "10 s if days are counted" in time.reason
    rows = (f"{46095.25 + 0.01 * k:.4f};{U[k]};{Y[k]}" for k in range(N))
    time = table_of(tmp_path, "Time;Valve;Level", rows).time
    assert time is not None and time.sure  # the uptime of a controller


def test_many_constant_columns_are_one_line_and_a_few_are_named(tmp_path: Path) -> None:
    for count, said in ((3, "c2: constant at 3"), (9, "constant columns: c1; c2; c3; c4; c5")):
        head = ",".join(["t [s]", "v", *(f"c{j}" for j in range(1, count + 1))])
        rows = (f"{k / 10},{U[k]}{',3' * count}" for k in range(N))
        found = inspect(written(tmp_path, (head, *rows))).findings
        assert sum("constant" in one for one in found) == (count if count < 5 else 1)
        assert any(one.startswith(said) for one in found)


def test_cells_that_hold_lists_are_told(tmp_path: Path) -> None:
    rows = (f'{k / 10};"[{U[k]}, {Y[k]}]"' for k in range(N))
    (said,) = inspect(written(tmp_path, ("t [s];position", *rows))).findings
    assert said.startswith("position: each cell holds several values ([")


def test_seconds_and_nanoseconds_of_no_message_are_a_stamp_too(tmp_path: Path) -> None:
    rows = (f"{1_700_000_000 + k // 4},{k % 4 * 250_000_000},{U[k]}" for k in range(N))
    time = table_of(tmp_path, "sec,nanosec,v", rows).time
    assert time is not None
    assert (time.column, time.rate) == ("stamp", pytest.approx(4.0))
