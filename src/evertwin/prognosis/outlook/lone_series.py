"""The life that one series tells, without a twin: a cell, a bearing, a tool.

What would be believed at a glance and is wrong all the same is asked back, with its row: a limit on
the other side of the values, or a thousand times off.

>>> import tempfile
>>> file = Path(tempfile.mkdtemp()) / "cell.csv"
>>> rows = [f"{k},{1.9 - 0.005 * k + 0.001 * (-1) ** k}" for k in range(60)]
>>> _ = file.write_text("cycle,capacity\\n" + "\\n".join(rows))
>>> lives = life_of_series(Series(file, 1.4, "below"))
>>> lives.clock, 20.0 < lives.components["capacity"].urgency < 60.0
('cycle', True)
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.config.prognosis import IndicatorSpec, PrognosisSpec
from evertwin.errors import DataError, UsageError, naming
from evertwin.prognosis.histories.contradictions import check_end, check_limit
from evertwin.prognosis.histories.headings import (
    clock_of,
    counting,
    is_timely,
    mileage_of,
    named,
    plainly,
    rising,
    seconds_of,
)
from evertwin.prognosis.histories.health import indicator_of, seen, today_of
from evertwin.prognosis.histories.history_file import counted_by, in_seconds, of_table
from evertwin.prognosis.histories.steps import back_of, check_steps, shift_of
from evertwin.prognosis.histories.value_columns import CLOCKS, value_columns
from evertwin.prognosis.laws import Fleet, Indicator, Life, Limit, Maintenance, predict_life
from evertwin.prognosis.laws.plans.alarms import alarm_of
from evertwin.prognosis.laws.series.calendar import FIRST, UNITS
from evertwin.prognosis.laws.series.indicator import Direction
from evertwin.prognosis.likes.like_machines import Likes, fleet_of, past_of
from evertwin.prognosis.outlook.lives import Lives, said, told_of
from evertwin.settings.quantity import written
from evertwin.signals.units import compatible, from_si, to_si
from evertwin.sources.columns.names import split_unit
from evertwin.sources.texts.small_table import Table, read_table
from evertwin.starter.looks.words import said_unit
from evertwin.types import Vector

FEW = 5
"""Values that tell where a series begins."""
WHOLE, LEAST = 0.2, 0.2
"""A share begins so near to 1, and its limit is no less."""
_AGAIN = 0.5
"""Share of rows that are of the run of the row before, from which on a run has many."""
SELDOM = 5.0
"""Seconds from one row to the next from which a table is no recording of motion."""


@dataclass(frozen=True)
class Series:
    """A file of values, and where life ends.

    >>> Series(Path("cell.csv"), 1.4, "below").column
    ''
    """

    file: Path
    limit: float | str
    """In the unit that the heading of the values gives, or in its own, as in '300 um'."""
    direction: Direction = "above"
    column: str = ""
    """Of the values; empty: the only one there is."""
    clock: str = ""
    """What life is counted in; empty: as the columns say."""
    fleet: tuple[Path, ...] = ()
    """Like machines until their end, in the same columns."""
    failed: tuple[Path, ...] = ()
    """Of these or others, those that failed with their last row."""
    from_today: bool = False
    """Counted from today, on condition that it still works; else from the newest row."""


def life_of_series(asked: Series, *, drawn: bool = False) -> Lives:
    """What the series says of the life; ``drawn``: with its course.

    Raises:
        DataError: a row or the limit contradicts the rest.
        UsageError: the column or the clock cannot be told.
    """
    table = read_table(asked.file)
    column = named(table, asked.column) if asked.column else _column(table)
    clock = asked.clock or _clock(table, asked.column)
    limit = Limit(
        _limit(asked.limit, table, column, below=asked.direction == "below"), asked.direction
    )
    rule = IndicatorSpec(
        column, parameter=column, limit=limit.value, direction=asked.direction,
        unit=table.written.get(column, ""),
    )  # fmt: skip
    known = of_table(rule, table, clock)
    own = indicator_of(rule, known, limit, clock, None)
    check_limit(own, f"{table.name}:{table.lines[0]}")
    check_end(own, table.name, table)
    check_steps(own, table.name, known.lines)
    bare = None if rule.unit else own
    likes = fleet_of(
        Likes(rule, limit, clock, asked.fleet, asked.failed, own=bare, past=past_of(own))
    )
    if asked.from_today:
        own = seen(own, today_of((own,)))
    one = told_of(rule, own, likes, drawn=drawn)
    own, life = one.indicator, one.life
    told = (*_shifted(own, one.fleet, known.lines), *_stepped_back(own, known.lines))
    told += _away(own, life)
    if not asked.clock and clock not in (*CLOCKS, mileage_of(table)):
        told += (f"{table.name}: life is counted by {clock}, which rises with every row",)
    own = own.with_(notes=(*own.notes, *told))
    one = replace(one, indicator=own)
    due = alarm_of(column, own, life, None, PrognosisSpec().risk)
    now = float(own.at[-1]) if len(own.at) else 0.0
    return Lives(
        asked.file.name, clock, {column: one}, None, () if due is None else (due,),
        dates=(), indicators=(one,), now=now,
    )  # fmt: skip


def _shifted(own: Indicator, fleet: Fleet | None, lines: Sequence[int]) -> tuple[str, ...]:
    """Says that a shift may be the sensor's, and what life there would be then."""
    shift = shift_of(own)
    if shift is None:
        return ()
    mark = Maintenance(float(own.at[shift.row]), "adjusted")
    other = predict_life(own.with_(maintenance=(*own.maintenance, mark)), fleet=fleet)
    sign = own.limit.sign
    return (
        f"{own.name} shifts from {own.shown(sign * shift.before)} to "
        f"{own.shown(sign * shift.after)} at once in row {lines[shift.row]} and goes on as before: "
        "was its sensor exchanged, or the part set anew? Then write adjusted there in a column "
        f"maintenance, for which this would be told: {said(other)}",
    )


def _stepped_back(own: Indicator, lines: Sequence[int]) -> tuple[str, ...]:
    """Asks whether a part was replaced, where a level went back to its begin and nobody says so."""
    back = back_of(own)
    if back is None:
        return ()
    sign = own.limit.sign
    return (
        f"{own.name} steps back from {own.shown(sign * back.before)} to "
        f"{own.shown(sign * back.after)}, about where its life began, in row {lines[back.row]}: "
        "was the part replaced there? Then write replaced there in a column maintenance",
    )


def _away(own: Indicator, life: object) -> tuple[str, ...]:
    """Says that values move away from the limit: it may lie on their other side."""
    apart = own.since_replaced().distance()
    apart = apart[np.isfinite(apart)]
    third = len(apart) // 3
    if isinstance(life, Life) or third < FEW:
        return ()
    first, last = apart[:third], apart[-third:]
    noise = float(np.median(np.abs(np.diff(apart))))
    if not np.quantile(last, 0.1) > np.quantile(first, 0.9) + noise:
        return ()
    other = "with --below" if own.limit.direction == "above" else "without --below"
    return (
        f"{own.name} moves away from its limit {own.limit.value:g} ({own.limit.direction}): is the "
        f"harmful side the other one ({other}, and its limit there)?",
    )


class Wear(NamedTuple):
    """A table that may tell wear.

    >>> Wear("cycle", ("capacity",), 168, True).command("cell.csv")
    'evertwin life cell.csv --limit X --below'
    """

    clock: str
    columns: tuple[str, ...]
    """Of values."""
    rows: int
    falls: bool
    """Whether the first of them falls on the whole."""
    of: str = ""
    """Column that says whose series a row is of, where there are several, one after the other."""
    series: int = 1

    @property
    def alone(self) -> bool:
        """Whether it can be nothing else: by run or cycle, or without a second column of values."""
        return self.clock in ("run", "cycle") or len(self.columns) == 1

    def command(self, file: str) -> str:
        """What tells its life."""
        column = f" --column {shlex.quote(self.columns[0])}" if len(self.columns) > 1 else ""
        said = f"{column} --limit X{' --below' * self.falls}"
        if self.of:
            return f"evertwin life ONE.csv{said} --fleet 'others/*.csv'"
        return f"evertwin life {shlex.quote(file)}{said}"


def wear_in(file: Path) -> Wear | None:
    """What a table tells if it tells wear: values by run, cycle or date, or seldom; else None."""
    try:
        table = read_table(file)
        clock, columns = _clock(table), value_columns(table)
        by = counted_by(table)
        step = np.inf
        if table.rows > 1 and by is not None and clock not in ("run", "cycle"):
            step = float(np.median(np.diff(in_seconds(table, by)[0])))
        elif by is None and counting(CLOCKS, table) is None and "s" not in table.names:
            return None
    except DataError:
        return None
    if not columns or table.rows < 2 or not step >= SELDOM:
        return None
    if clock in table.names and np.mean(np.diff(table.column(clock)) == 0.0) > _AGAIN:
        return None  # a recording of each run, not a row
    of, series = _whose(table, clock, columns)
    columns = tuple(name for name in columns if name != of)
    begins = 1 if series == 1 else int(np.flatnonzero(np.diff(table.column(clock)) < 0)[0]) + 1
    ways = [_way(table.column(name)[: None if series == 1 else begins]) for name in columns]
    worn = Wear(clock, columns, table.rows, ways[0] < 0, of, series)
    if worn.alone:
        return worn
    going = [k for k, way in enumerate(ways) if abs(way) > 1]  # wear goes one way
    if not going:
        return None
    k = going[0]
    return worn._replace(columns=(columns[k], *columns[:k], *columns[k + 1 :]), falls=ways[k] < 0)


def _whose(table: Table, clock: str, columns: tuple[str, ...]) -> tuple[str, int]:
    """The column that stays while the clock goes on, and how often that starts; none: "", 1."""
    if clock not in table.names or len(columns) < 2:
        return "", 1
    over = np.diff(table.column(clock)) < 0
    for name in columns if over.any() else ():
        if np.array_equal(np.diff(table.column(name)) != 0, over):
            return name, int(over.sum()) + 1
    return "", 1


def _way(values: Vector) -> int:
    """1: rises on the whole, 2: so that its last third lies above its first; less than 0: falls."""
    known = values[np.isfinite(values)]
    third = max(len(known) // 3, 1)
    first, last = known[:third], known[-third:]
    if not len(known) or np.median(last) == np.median(first):
        return 0
    sign = 1 if np.median(last) > np.median(first) else -1
    low, high = (first, last) if sign > 0 else (last, first)
    return sign * (2 if np.quantile(high, 0.1) > np.quantile(low, 0.9) else 1)


def _limit(said: float | str, table: Table, column: str, *, below: bool) -> float:
    """Where life ends, in the unit of the values.

    Raises:
        UsageError: it is no number, or in a unit that the values have not.
    """
    if not isinstance(said, str):
        return said
    with naming("--limit"):
        number, unit = written(said)
    values = table.column(column)
    own = table.written.get(column) or split_unit(column)[1] or said_unit(column)
    if not unit:
        shown = from_si(values, own) if column in table.units else values
        _check_share(number, np.asarray(shown)[np.isfinite(values)], own, below)
    if not unit or (own and compatible(unit, own)):
        return float(from_si(to_si(number, unit), own)) if unit else number
    if unit == "%":
        first = float(values[np.isfinite(values)][0]) if np.isfinite(values).any() else np.nan
        first = float(from_si(first, own)) if column in table.units else first
        raise UsageError(
            f"--limit {said!r}: per cent of what? Say the value itself: of the first {column}, "
            f"{first:.4g}, it is --limit {0.01 * number * first:.4g}"
        )
    expected = f"a unit like {own!r}" if own else f"a number alone, for {column} states no unit"
    raise UsageError(f"--limit {said!r}: expected {expected}, got {unit!r}")


def _check_share(limit: float, value: Vector, unit: str, below: bool) -> None:
    """Asks back a share of 1 as the limit of values in per cent, or the reverse."""
    first = float(np.median(value[:FEW])) if len(value) else 0.0
    share, percent = abs(first - 1.0) <= WHOLE, abs(first - 100.0) <= 100.0 * WHOLE
    other = limit * 100.0 if percent and LEAST <= limit <= 1.0 else (
        limit / 100.0 if share and 100.0 * LEAST <= limit <= 100.0 else 0.0
    )  # fmt: skip
    if other and (unit == "%" or (below and not unit)):
        raise UsageError(
            f"--limit {limit:g}: values begin at {first:.4g}: is it {other:g} in their unit? Else "
            "state its unit, and that of the values in their heading"
        )


def _column(table: Table) -> str:
    """The only column of values."""
    there = value_columns(table)
    for name, cells in table.text.items() if not there else ():
        if 2 * sum(cell[:1] in set("+-0123456789") for cell in cells) > len(cells):
            table.column(name)  # says by which cell it holds no numbers
    if len(there) != 1:
        by = rising(table) if _clock(table) == "run" else None
        also = f"; life is counted by {by}, which rises with every row, where you name another"
        raise UsageError(
            f"{table.name}: expected one column of values, got {', '.join(there) or 'none'}: name "
            f"it with --column{also if by else ''}"
        )
    return there[0]


def _clock(table: Table, column: str = "") -> str:
    """What life is counted in, by the columns that there are beside a ``column`` that was named."""
    names = {plainly(n) for n in table.names if is_timely(table, n)}
    if found := [clock for clock in CLOCKS if clock in names]:
        return found[0]
    if by := counting(("run", "cycle"), table):
        return clock_of(by)
    by = counted_by(table)
    if by is None:
        by = counting(("h", "d"), table)
        way = mileage_of(table) or (rising(table, column) if column else None)
        return clock_of(by) if by else way or "run"
    if by not in table.units and seconds_of(by) != 1.0:
        return "h" if seconds_of(by) < UNITS["h"] else "d"
    at, _ = in_seconds(table, by)
    span = float(np.ptp(at))
    if by not in table.dates and not np.all(at > FIRST):
        return "s"
    return "d" if span > 20.0 * 86_400.0 else "h"
