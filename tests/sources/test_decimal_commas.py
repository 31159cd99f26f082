"""Decimal commas and thousands: what reads in one way is read, else it is said what to do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.sources.texts.dialect import FOUND, Stated
from evertwin.sources.texts.small_table import parse
from evertwin.sources.texts.text import TextTable

QUOTED = 't,x\n"0","{}"\n"1","{}"\n"2","{}"\n'


def values(path: Path, text: str, stated: Stated = FOUND) -> Any:
    (path / "run.csv").write_text(text)
    table = TextTable(path / "run.csv", stated=stated)
    names = [column.name for column in table.columns]
    return np.concatenate([rows.values for rows in table.rows(names, None)]).T.tolist()


def test_quoted_decimal_commas_are_read_and_quoted_thousands_are_not(tmp_path: Path) -> None:
    assert values(tmp_path, QUOTED.format("100,02", "-1,5", "0,25"))[1] == [100.02, -1.5, 0.25]
    with pytest.raises(DataError, match=r"run.csv:2: column 'x': .*decimal comma or thousands\?"):
        values(tmp_path, QUOTED.format("1,049", "2,500", "3,000"))


def test_points_that_part_thousands_are_asked_for_and_read_once_said(tmp_path: Path) -> None:
    text = "t;x\n523.417;100,25\n523.422;-1,5\n1.523.427;0,5\n"
    with pytest.raises(DataError, match=r"'523.417' in column 't' has a point.*decimal = ','"):
        values(tmp_path, text.replace("1.523", "523"))
    with pytest.raises(DataError, match=r"'1.523.427': points that part thousands.*decimal = ','"):
        values(tmp_path, text)
    times = [523417.0, 523422.0, 1523427.0]
    assert values(tmp_path, text, Stated(decimal=",")) == [times, [100.25, -1.5, 0.5]]
    later = "t;x\n" + "".join(f"{i};{i},5\n" for i in range(60)) + "60;1.000,5\n"
    assert values(tmp_path, later)[1][-1] == 1000.5


def test_headings_in_the_middle_of_a_file(tmp_path: Path) -> None:
    text = "t,x\n" + "".join(f"{i},{i}.5\n" for i in range(70)) + "t,x\n0,1.5\n"
    with pytest.raises(DataError, match=r"run.csv:72: .*the headings again"):
        values(tmp_path, text)


def test_headings_again_where_the_rows_go_on_are_left_out_and_counted(tmp_path: Path) -> None:
    rows = [f"{i};{i},5" for i in range(140)]
    (tmp_path / "run.csv").write_text("\n".join(["t;x", *rows[:70], '"t";x', *rows[70:], ""]))
    table = TextTable(tmp_path / "run.csv")
    for strict in (True, False):
        (found,) = table.rows(["t", "x"], None, strict)
        assert found.values[:, 0].tolist() == list(range(140)) and found.line[70] == 73
        assert [(p.kind, p.line) for p in found.problems] == [("heading", 72)]


def test_dates_by_day_month_and_year() -> None:
    table = parse(["Datum;w", "06.01.2025;1,5", "13.01.2025 06:00;1,6", ";2"], "h.csv")
    days = table.column("Datum") / 86400.0 - 20094.0  # from 2025-01-06 on
    assert days[:2].tolist() == [0.0, 7.25] and np.isnan(days[2])
    american = parse(["d,w", "01.06.2025,1.5", "01.13.2025,1.6"], "h.csv").column("d")
    assert np.diff(american).tolist() == [7 * 86400.0]
    with pytest.raises(DataError, match=r"h.csv:2: d: .*'03.04.2025', and no row says"):
        parse(["d,w", "03.04.2025,1.5", "05.04.2025,1.6"], "h.csv")
