"""What a history says and cannot mean: asked back with its row, not believed.

A time far from all others, a value a thousand times off, a limit in another unit or on the other
side of the values. Each is told by how far it lies from what the rest of the same history says.

>>> from evertwin.prognosis.laws import Limit
>>> cell = Indicator.of("capacity", "Ah", Limit(1.4), np.arange(9.0), 1.9 - 0.02 * np.arange(9))
>>> check_limit(cell, "cell.csv:2")  # doctest: +ELLIPSIS
Traceback (most recent call last):
...
evertwin.errors.DataError: cell.csv:2: capacity: expected a life that begins on the sound side ...
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evertwin.errors import DataError
from evertwin.prognosis.histories.headings import dated
from evertwin.prognosis.laws import Indicator
from evertwin.prognosis.laws.series.calendar import UNITS, Calendar
from evertwin.sources.texts.small_table import Table
from evertwin.types import Vector

FAR = 300.0
"""Ratio at which one of two numbers is taken for a slip."""
SLIPS, NEARLY = (1e3, 1e5, 1e6), 0.05
"""Factors that make of a value in a larger unit one like its neighbours, and by how much it may
miss them beside their scatter."""
FEW = 5
"""First values that tell on which side of the limit a life begins."""
APART, YEARS = 10.0, 5.0
"""A date lies far off beyond so many times the span of the others, and so many years; a row that
stands between others in the file, beyond the former alone."""
LONE = 1000.0
"""A count lies far off beyond so many times the span of the others."""
STEPS = 6.0
"""Usual steps from one value to the next that no value is a slip within."""
SMALL = 0.05
"""Share of the rows that may lie far off in time together."""
FACTORS, ALIKE, MOST, NEAR_ZERO = (25.4, 1000.0, 14.5), 0.25, 0.8, 0.05
"""Between units that people mix up; how alike machines begin, how many of them, and from which
share of the limit on that tells anything."""
ZEROS = 3
"""Zeros at the end that are no slip of one reading; as many values beyond the limit end a life."""
SERIAL = (36_526.0, 73_050.0)
"""Numbers by which spreadsheets count the days of 2000 to 2099."""
SET_BACK = 3700.0
"""Seconds by which a clock is set back where summer time ends, and some."""
SUNDAY, NIGHT = 3, 3.0
"""Days since 1970, in weeks, of its night, and until which hour it is set back."""
_YEAR = 365.25 * UNITS["d"]


def is_serial(table: Table, name: str) -> bool:
    """Does a column count days as spreadsheets do?

    >>> is_serial(Table("a.csv", {"Datum": np.array([46027.3, 46028.3])}), "Datum")
    True
    """
    at = table.numbers.get(name, np.zeros(0))
    at = at[np.isfinite(at)]
    if name in table.dates or not dated(name) or not len(at):
        return False
    return bool(np.all((at > SERIAL[0]) & (at < SERIAL[1])))


def refuse_number(table: Table, name: str) -> None:
    """Says that a column of dates holds plain numbers.

    Raises:
        DataError: always.
    """
    at = float(table.column(name)[0])
    day = f"{np.datetime64('1899-12-30') + int(at)}" if is_serial(table, name) else ""
    meant = f" (a spreadsheet's number for {day}: format the column as dates)" if day else ""
    raise DataError(
        f"{table.name}:{table.lines[0]}: {name}: expected dates as in 2027-03-01, got {at:.10g}: "
        f"write it so{meant}, or name a column of seconds t"
    )


def doubled(
    table: Table, name: str, by: str, at: Vector, rows: tuple[np.ndarray, np.ndarray]
) -> str:
    """What to do about two values of ``name`` for one moment: rows of the first, and of the second.

    >>> again = Table("a.csv", {"h": np.array([0.0, 9.0, 0.0])}, lines=(2, 3, 4))
    >>> doubled(again, "x", "h", again.numbers["h"], (np.array([0]), np.array([2])))[:26]
    'h starts again in row 4: c'
    """
    first, second = rows
    if set_back(table, by, at, (int(first[0]), int(second[0]))):
        return "was the clock set back there? Write dates in UTC, or with their zone"
    columns = {n: np.asarray(c) for n, c in (*table.text.items(), *table.numbers.items())}
    for other, cells in columns.items():
        few = 2 * len(np.unique(cells)) <= len(cells)
        if other != name and few and len(first) > 1 and (cells[first] != cells[second]).all():
            return (
                f"delete one, or write their mean; of several machines keep the rows of one {other}"
            )
    falls = np.flatnonzero(np.diff(at) < 0.0) + 1
    if len(falls) and 3 * len(falls) <= len(at) and (at[falls] - at[0] <= 0.25 * np.ptp(at)).all():
        return (
            f"{by} starts again in row {table.lines[falls[0]]}: count on there beyond "
            f"{at[falls[0] - 1]:g}, with 'replaced' in a column maintenance if a new life began"
        )
    return "delete one, or write their mean"


def set_back(table: Table, by: str, at: Vector, rows: tuple[int, int]) -> bool:
    """Was the clock set back between two rows of one moment, by seconds ``at``?

    Of hourly rows nothing falls: one stands there twice, in the night of a Sunday.
    """
    if by not in table.dates or by in table.zoned:
        return False
    falls = np.diff(at[min(rows) : max(rows) + 1])
    falls = falls[falls < 0.0]
    days, hour = divmod(float(at[rows[0]]) / UNITS["h"], 24.0)
    night = days % 7 == SUNDAY and 0.0 < hour <= NIGHT
    return night if not len(falls) else len(falls) == 1 and bool(falls[0] >= -SET_BACK)


def check_times(table: Table, by: str, at: Vector, calendar: Calendar | None) -> None:
    """Asks back where some rows lie far from the others in time, or ahead of today.

    Args:
        table: the history.
        by: its column of times.
        at: on the clock.
        calendar: where that clock counts from 1970.

    Raises:
        DataError: with the row.
    """
    row = _odd(at, calendar) if len(at) > FEW else None
    if row is None:
        return
    rest, reason = np.delete(at, row), ""
    if calendar is not None and at[row] > _tomorrow(calendar):
        rest, reason = at[at <= _tomorrow(calendar)], ", which lies ahead of today"
    first, last, got = (
        f"{x:g}" if calendar is None else calendar.said(x)
        for x in (float(rest.min()), float(rest.max()), float(at[row]))
    )
    raise DataError(
        f"{table.name}:{table.lines[row]}: {by}: expected a time like those of the other rows "
        f"({first} to {last}), got {got}{reason}: correct it, or delete the row"
    )


def _tomorrow(calendar: Calendar) -> float:
    """On its clock: zones differ by up to a day."""
    return calendar.today() + UNITS["d"] / UNITS[calendar.clock]


def _odd(at: Vector, calendar: Calendar | None) -> int | None:
    """The first row, in the file, whose time is no neighbour's; None where there is none."""
    few = max(SMALL * len(at), 1.0)
    order = np.argsort(at, kind="stable")
    gaps = np.diff(at[order])
    k = int(np.argmax(gaps)) + 1
    apart, rest = (order[k:], order[:k]) if 2 * k >= len(at) else (order[:k], order[k:])
    span = float(np.ptp(at[rest]))
    far = LONE * span
    if calendar is not None:
        unit = UNITS[calendar.clock]
        far = max(APART * span, YEARS * _YEAR / unit)
        ahead = np.flatnonzero(at > _tomorrow(calendar))
        if 0 < len(ahead) <= few:
            return int(ahead[0])
    if np.any(np.diff(at) < 0.0) and np.all(np.diff(np.delete(at, apart)) >= 0.0):
        far = APART * span  # nothing but these stands where it does not belong
    lonely = len(apart) <= few and span > 0.0 and gaps[k - 1] > far
    return int(apart.min()) if lonely else None


def check_values(table: Table, name: str, value: Vector, since: np.ndarray) -> None:
    """Asks back where some values are in another unit than the others.

    Args:
        table: the history.
        name: its column of values.
        value: the values.
        since: number of the life that each row belongs to: a new part may begin near zero.

    Raises:
        DataError: with the row.
    """
    for life in np.unique(since):
        own = np.flatnonzero((since == life) & np.isfinite(value))
        usually = STEPS * float(np.median(np.abs(np.diff(value[own])))) if len(own) > FEW else 0.0
        for place, k in enumerate(own.tolist() if len(own) > FEW else ()):
            near = value[own[max(place - FEW, 0) : place] if place >= FEW else own[1 : FEW + 1]]
            usual, here = float(np.median(np.abs(near))), abs(float(value[k]))
            if not (np.ptp(near) < 0.5 * usual and here > 0.0 and abs(here - usual) > usually):
                continue  # they pass zero, or scatter as much: any value may follow
            before = np.abs(value[own[:place]])
            back = np.sum((0.5 * here < before) & (before < 2.0 * here)) >= FEW
            room = 2.0 * float(np.ptp(near)) + NEARLY * usual
            less = any(abs(here * factor - usual) <= room for factor in SLIPS)
            # a machine that stands still shows anything near zero, and goes on as before
            if (here > FAR * usual and not back) or (usual > FAR * here and less):
                raise DataError(
                    f"{table.name}:{table.lines[k]}: {name}: expected a value of about "
                    f"{usual:.4g} as in the rows beside it, got {value[k]:.4g}: is it in another "
                    "unit, or was the part replaced? Correct the row, or say so in a column "
                    "maintenance"
                )


def check_limit(own: Indicator, where: str, *, alone: bool = True) -> None:
    """Asks back where limit and values contradict each other.

    Args:
        own: the series.
        where: its file and first row.
        alone: nothing but the series tells where it stands; else it may have passed long ago.

    Raises:
        DataError: with the place.
    """
    life = own.since_replaced()
    good = np.flatnonzero(np.isfinite(life.value))
    if not len(good):
        return
    value, limit, name = life.value[good], own.limit.value, own.name
    size = float(np.median(np.abs(value)))
    from_zero = np.ptp(value) > 0.5 * size
    third = len(value) // 3
    if from_zero and third >= FEW:
        grown = np.quantile(np.abs(value[-third:]), 0.1) > np.quantile(np.abs(value[:third]), 0.9)
        size, from_zero = float(np.max(np.abs(value))), not grown
    if limit and size and not from_zero and not 1.0 / FAR < abs(limit) / size < FAR:
        raise DataError(
            f"{where}: {name}: values are about {size:.4g}, the limit is {limit:g}: "
            f"{abs(limit) / size:.3g} times as much: is one of them in another unit?"
        )
    apart = life.distance()[good]
    few = min(FEW, len(good))
    nearer = float(np.median(apart[-few:])) > float(np.median(apart[:few]))
    if np.all(apart[:few] <= 0.0) and (nearer or (alone and np.all(apart <= 0.0))):
        other = "below (--below" if own.limit.direction == "above" else "above (without --below"
        raise DataError(
            f"{where}: {name}: expected a life that begins on the sound side of the limit, got "
            f"{value[0]:.4g} with a limit {limit:g} ({own.limit.direction}): is the harmful side "
            f"{other}, or direction in the twin file)?"
        )


def check_units(lives: Sequence[Indicator], own: Indicator) -> None:
    """Asks back where like machines begin alike but for a factor between units.

    Args:
        lives: those of like machines, by the names of their files.
        own: the machine that is asked for.

    Raises:
        DataError: with the file.
    """
    first, starts = _begins(own), np.array([_begins(one) for one in lives])
    if not abs(first) > NEAR_ZERO * abs(own.limit.value):
        return
    with np.errstate(all="ignore"):
        ratios = np.maximum(starts / first, first / starts)
    known = ratios[np.isfinite(ratios)]
    off = np.abs(known[:, None] / np.array([1.0, *FACTORS]) - 1.0).min(axis=1, initial=np.inf)
    if not len(known) or np.mean(off < ALIKE) < MOST:
        return  # they begin as they like
    for one, start, ratio in zip(lives, starts.tolist(), ratios.tolist(), strict=True):
        factor = next((f for f in FACTORS if abs(ratio / f - 1.0) < ALIKE), 0.0)
        if factor:
            raise DataError(
                f"{one.name}: {own.name}: begins at {start:.4g}, the machine asked for at "
                f"{first:.4g}, {factor:g} times apart: is it in another unit? State the units in "
                f"the headings, as in {own.name} [mm], or leave the file out"
            )


def _begins(one: Indicator) -> float:
    value = one.value[np.isfinite(one.value)]
    return float(np.median(value[:FEW])) if len(value) else float("nan")


def check_end(own: Indicator, name: str, table: Table | None = None) -> None:
    """Asks back where a life leaps to exactly zero and stays: no wear does, a dead sensor may.

    Args:
        own: the series.
        name: its file.
        table: that file, where its rows can be told.

    Raises:
        DataError: with the rows.
    """
    life = own.since_replaced()
    value = life.value[np.isfinite(life.value)]
    rest = value[value != 0.0]
    count = len(value) - 1 - int(np.flatnonzero(value)[-1]) if len(rest) else 0
    if count < ZEROS or own.failed is not None or not abs(rest[-1]) > np.ptp(rest):
        return
    since = own.moment(float(life.at[np.isfinite(life.value)][-count]))
    if table is not None and own.name in table.names:
        there = [table.lines[k] for k in np.flatnonzero(table.column(own.name) == 0.0)[-count:]]
        name, since = f"{name}:{there[0]}", f"{since} (rows {there[0]} to {there[-1]})"
    raise DataError(
        f"{name}: {own.name}: expected values that go on from {rest[-1]:.4g}, got {count} that are "
        f"exactly 0 since {since}: readings that were broken off, or a dead sensor? Delete these "
        "rows, or say failed in a column maintenance"
    )
