"""Columns of time: which unit one is in when nobody says, and how far two clocks are apart.

The heading decides if it states a unit; then the size of the numbers, because stamps counted from
1970 lie in another decade for each unit; then the spacing. Whole numbers that advance by ten or
more a row could be seconds or milliseconds: that is said, and must be answered in the twin file.

>>> import numpy as np
>>> guess("t", np.array([1614859007119846022, 1614859010160238574])).unit
'ns'
>>> guess("time_ms", np.array([0.0, 20.0])).unit, guess("Time (min)", np.array([0.0, 0.25])).unit
('ms', 'min')
>>> guess("t", np.array([0, 20, 40])).sure
False

A logger that writes the device's stamp beside its own, or a message with a header stamp that was
logged later, tells both times of every row. Their difference over the first clock is a line: its
height is the offset, its slope the drift, and the scatter about it what the transport adds.

>>> line = Line()
>>> t = np.arange(1000) * 10**7
>>> line.add(t, t + 2 * 10**8 + t // 10**4)
>>> found = line.result("device [s]")
>>> round(found.offset, 3), round(found.drift * 1e6), found.rows
(0.2, 100, 1000)
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.signals.units import compatible
from evertwin.sources.clocks.dates import ORDERS, is_date, is_whole, order_of
from evertwin.sources.clocks.exported import parts_of
from evertwin.sources.clocks.stamps import NO_STAMP, to_ns
from evertwin.sources.columns.description import ClockInfo
from evertwin.sources.columns.names import unit_problem
from evertwin.sources.columns.table import Column, Table
from evertwin.types import Int64, Stamps

_HINTS = {
    "ns": {"ns", "nsec", "nanos", "nanosec", "nanosecond", "nanoseconds"},
    "us": {"us", "µs", "usec", "micros", "microsecond", "microseconds"},
    "ms": {"ms", "msec", "millis", "millisecond", "milliseconds"},
    "s": {"s", "sec", "secs", "second", "seconds", "sekunden", "secondes", "secondi", "segundos"},
    "min": {"min", "mins", "minute", "minutes", "minuten", "minuti", "minutos"},
    "h": {"h", "hr", "hrs", "hour", "hours", "stunde", "stunden", "heures", "ore", "horas"},
}
_ALL_HINTS = frozenset[str]().union(*_HINTS.values())
_STATED, EPOCH = "stated in the heading", "counted from 1970"
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$")
_FIRST, _LAST = 946_684_800, 4_102_444_800
"""The years 2000 and 2100 [s]."""
_DAYS = 36_526, 73_051
"""The same as a spreadsheet counts them, from 1900 on [d]."""


class TimeGuess(NamedTuple):
    """A unit of time, why, and whether it can be relied on.

    >>> TimeGuess("s", "heading", True).sure
    True
    """

    unit: str
    reason: str
    sure: bool
    step: float = 0.0
    """What numbers that are counted from anywhere advance by a row; 0: they are none."""

    @property
    def stated(self) -> bool:
        """Whether the file says it."""
        return self.reason == _STATED

    @property
    def evident(self) -> bool:
        """Whether the file says it, or the years since 1970 do."""
        return self.stated or self.reason == EPOCH


def guess(heading: str, raw: np.ndarray, stated: str = "") -> TimeGuess:
    """The unit of a raw column of time.

    Args:
        heading: the column's name.
        raw: some rows of it, (n,).
        stated: unit that the file itself states, empty if none.
    """
    if raw.dtype.kind in "mM":
        return TimeGuess("iso", "calendar stamps" if raw.dtype.kind == "M" else "durations", True)
    if raw.dtype.kind == "S" and any(is_date(cell) for cell in _texts(raw)):
        return _dated(raw)
    if raw.dtype.kind == "S":
        raw = raw[np.array([_NUMBER.match(cell) is not None for cell in raw.tolist()], np.bool_)]
    found = TimeGuess("s", "no stamp to tell it by", False)
    for whole in (True,) if _whole(raw) else (False, True):  # far too large for s: decimals aside
        stamps = to_ns(raw, "ns" if whole else "s")
        stamps = stamps[stamps != NO_STAMP]
        if len(stamps):
            found = _by_size(stamps, whole)
            break
    words = {stated.lower(), *re.split(r"[^a-zµ]+", heading.lower())}
    for unit, hints in _HINTS.items():
        if words & hints:
            return TimeGuess(unit, _STATED, True, found.step)
    return found


def told(table: Table, time: Column, raw: np.ndarray) -> TimeGuess:
    """The unit of a column of time; where the day of its first rows is not clear, the rows that
    follow may say it.

    Args:
        table: it is read on where that is needed.
        time: its column of time.
        raw: the first rows of it, (n,).
    """
    found = guess(time.name, raw[:1000], time.unit)
    if found.sure or found.unit not in ORDERS:
        return found
    pieces = (_dated(rows.time) for rows in table.rows([], time.name, strict=False))
    return next((piece for piece in pieces if piece.sure), found)


def _dated(raw: np.ndarray) -> TimeGuess:
    order, sure = order_of(bytes(cell) for cell in raw.tolist())
    said = "times of day" if order == "clock" else "dates"
    return TimeGuess(order, said if sure else "dates of which no row tells day from month", sure)


def _texts(raw: np.ndarray) -> list[bytes]:
    return [bytes(cell) for cell in raw[:20].tolist()]


def _whole(raw: np.ndarray) -> bool:
    """True where no stamp has decimals."""
    if raw.dtype.kind == "S":
        return all(cell.isdigit() or float(cell).is_integer() for cell in raw.tolist())
    if raw.dtype.kind in "iu":
        return True
    finite = raw[np.isfinite(raw)]
    return bool(np.all(finite == np.floor(finite)))


def _by_size(stamps: np.ndarray, whole: bool) -> TimeGuess:
    """By the epoch, else by the spacing. ``stamps``: plain numbers if whole, else 1e9 × number."""
    number = float(np.median(stamps)) / (1 if whole else 1e9)
    step = float(np.median(np.diff(np.sort(stamps)))) if len(stamps) > 1 else 0.0
    step /= 1 if whole else 1e9
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        seconds = step / factor
        if _FIRST * factor <= number < _LAST * factor and seconds < 86_400 * 31:
            return TimeGuess(unit, EPOCH, True)
    if whole and step >= 10:
        unit = "ms" if step < 1e4 else "us" if step < 1e6 else "ns"
        unit = "s" if step <= 3600 and step % 60 == 0 else unit  # nobody samples each 60 ms
        return TimeGuess(unit, f"whole numbers that advance by {step:g} a row", False, step)
    said, seconds = f"advances by {step:g} a row", 86_400 * step
    odd = abs(step - float(f"{step:.3g}")) > 1e-4 * step  # for seconds, and whole if it is days
    if _DAYS[0] <= number < _DAYS[1] and odd and 1 <= round(seconds, 2) == round(seconds):
        said += f", which is {seconds:.0f} s if days are counted as in a spreadsheet: write dates"
        return TimeGuess("s", said, False, step)
    return TimeGuess("s", said, True, step)


NAMES = ("t", "time", "timestamp", "stamp", "times", "datetime", "date", "zeit", "seconds", "secs")
"""Usual first words of a column of time."""
_PERHAPS = {
    "epoch", "unix", "unixtime", "utc", "ts", "elapsed", "uptime", "zeitstempel", "temps", "tiempo",
    "tempo", "tijd",
}  # fmt: skip
"""First words of one that grows: a ``Ts`` may be a constant; an epoch that counts is a round."""


_OWN = ["header", "stamp"]
"""Last words of a message's own stamp."""


def time_column(table: Table) -> Column | None:
    """The column that holds the stamps: by its kind, its name, or first and increasing.

    A bag's own stamps come first; then calendar stamps; then usual names; then times of day; then
    dates without a time; then a unit of time that the file states of a column that grows; then the
    first column, if it is a number that grows all through the first rows, and nearly all through
    thousands. What counts rows is no time, nor is what states a unit of anything else; a ``t`` that
    falls as often as it grows is a temperature.
    """
    columns = table.columns
    numbers = [c for c in columns if c.kind == "number" and not _states(c, of_time=False)]
    usual = [c for c in numbers if _usual(c) and (_named(c) or _grows(table, c, 0.1))]
    usual = usual or [c for c in numbers if _may_be(c) and _grows(table, c, 0.1)]
    rounds = [c for c in usual if "epoch" in _words(c.name)[:1]]
    usual = [c for c in usual if c not in rounds or _goes_on(table, c, 0.1)]
    dated = sorted(
        ((_lacks(table, column), column) for column in columns if column.kind == "time"),
        key=lambda pair: pair[0],
    )
    if dated and not (usual and dated[0][0]):
        return _of_one_day(table, dated[0][1])
    stated = (c for c in numbers if _states(c, of_time=True) and _grows(table, c, 0.01))
    found = next(iter(usual), None) or next(stated, None)
    if found is not None:
        return found
    several = sum(column.kind == "number" for column in columns) > 1
    if not several or columns[:1] != tuple(numbers[:1]) or "seq" in _words(columns[0].name):
        return None
    return columns[0] if _goes_on(table, columns[0], 0.01) else None


def _states(column: Column, of_time: bool) -> bool:
    """Does it state a unit of time, or of anything else?"""
    unit = column.unit
    if not unit or unit == "1" or (unit.lower() not in _ALL_HINTS and unit_problem(unit)):
        return False
    return (unit.lower() in _ALL_HINTS or compatible(unit, "s")) == of_time


def _named(column: Column) -> bool:
    """Does its name say no more than ``t`` and a unit of time? ``t_in`` is a temperature, too."""
    said = map(_words, (column.name, *column.also))
    return any(one and (one[0] != "t" or _ALL_HINTS.issuperset(one[1:])) for one in said)


def _goes_on(table: Table, column: Column, back: float) -> bool:
    """Does it grow, and not by one a row? What is counted from 1970 may."""
    counts = bool(len(steps := _steps(table, column)) and (steps == 1.0).mean() > _COUNTS)
    if counts and not _since_1970(table, column):
        return False
    return _grows(table, column, back)


def _since_1970(table: Table, column: Column) -> bool:
    rows = next(iter(table.rows([column.name], None, strict=False)))
    return guess("", rows.values[:1000, 0]).evident


_COUNTS = 0.9
"""Share of steps of one from which on a column counts the rows."""


def _steps(table: Table, column: Column) -> np.ndarray:
    """From row to row, in the first rows."""
    rows = next(iter(table.rows([column.name], None, strict=False)), None)
    steps = np.diff(rows.values[:, 0]) if rows is not None else np.zeros(0)
    return steps[np.isfinite(steps)]


def _grows(table: Table, column: Column, back: float) -> bool:
    """Does it grow through the first rows, and through thousands but for a share of steps
    ``back``? An angle, too, grows for a while."""
    steps = _steps(table, column)
    if len(steps) < 2:
        return False
    first = back > 0.01 or bool((steps[:100] >= 0).all())
    return first and bool((steps > 0).mean() > 0.5) and bool((steps < 0).mean() < back)


def _of_one_day(table: Table, column: Column) -> Column:
    """A column of dates, or of the times of day beside it: of one day they tell rows apart."""
    columns = table.columns
    time = getattr(table, "times", {}).get(columns.index(column))
    if time is None:
        return column
    whole, times = (
        next(iter(table.rows([], one.name, strict=False))).time.tolist()
        for one in (column, columns[time])
    )
    days = {bytes(a).removesuffix(bytes(b)) for a, b in zip(whole, times, strict=True)}
    return columns[time] if len(days) == 1 and all(map(is_date, times[:20])) else column


def _usual(column: Column) -> bool:
    return any(map(is_usual, (column.name, *column.also)))


def _may_be(column: Column) -> bool:
    return any(not _PERHAPS.isdisjoint(_words(name)[:1]) for name in (column.name, *column.also))


def is_usual(name: str) -> bool:
    """Is a column of time called so?

    >>> [is_usual(name) for name in ("Time (s)", "header.stamp", "row")]
    [True, True, False]
    """
    words = _words(name)
    return bool(words[:1] and words[0] in NAMES) or words[-2:] == _OWN


def _words(name: str) -> list[str]:
    return [word for word in re.split(r"[^a-z]+", name.lower()) if word]


def _lacks(table: Table, column: Column) -> int:
    """What the stamps of a text lack: 0 nothing, 1 the date, 2 the time of day."""
    rows = next(iter(table.rows([], column.name, strict=False)), None)
    if rows is None or rows.time.dtype.kind != "S":
        return 0
    cells = [cell for cell in _texts(rows.time) if is_date(cell)]
    if not cells or any(map(is_whole, cells)):
        return 0
    return 1 if order_of(cells)[0] == "clock" else 2


@dataclass
class Line:
    """Least squares of (second − first) over the first clock, from sums; times from the first row.

    >>> Line().rows
    0
    """

    rows: int = 0
    origin: tuple[int, int] = (0, 0)
    sums: list[float] = field(default_factory=lambda: [0.0] * 5)
    steps: int = 0
    forward: int = 0

    def add(self, first: Stamps, second: Int64[np.ndarray, " n"]) -> None:
        """More rows: stamps of both clocks [ns]."""
        if len(first) == 0:
            return
        if self.rows == 0:
            self.origin = (int(first[0]), int(second[0]) - int(first[0]))
        x = (first - self.origin[0]) * 1e-9
        y = (second - first - self.origin[1]) * 1e-9
        more = (x.sum(), y.sum(), (x * x).sum(), (x * y).sum(), (y * y).sum())
        self.sums = [a + float(b) for a, b in zip(self.sums, more, strict=True)]
        self.rows += len(x)
        self.steps += len(x) - 1
        self.forward += int((np.diff(second) > 0).sum())

    def result(self, column: str) -> ClockInfo | None:
        """Offset in the middle, drift and scatter; None where it is no clock, or too few rows."""
        sx, sy, sxx, sxy, syy = self.sums
        n = self.rows
        wide = sxx - sx * sx / n if n else 0.0
        if n < 3 or wide <= 0 or self.forward < 0.5 * self.steps:
            return None
        drift = (sxy - sx * sy / n) / wide
        left = max(syy - sy * sy / n - drift * drift * wide, 0.0)
        jitter = float(np.sqrt(left / (n - 2)))
        offset = self.origin[1] * 1e-9 + sy / n
        return ClockInfo(column, offset, drift, jitter / float(np.sqrt(wide)), jitter, n)


def other_clocks(table: Table, first: Column) -> tuple[ClockInfo, ...]:
    """Every further column of time, compared with the first, in one more pass over the table."""
    found, parts = [], parts_of(column.name for column in table.columns)
    for column in table.columns:
        if column != first and column.name not in parts and _tells_time(column):
            line = _line(table, first, column)
            info = None if line is None else line.result(column.name)
            # A clock that runs twice as fast as the other is a counter or another unit.
            if info is not None and abs(info.drift) < 0.1:
                found.append(info)
    return tuple(found)


def _tells_time(column: Column) -> bool:
    words = _words(column.name)
    if _states(column, of_time=False):
        return False
    named = bool(words) and (words[0] in NAMES or any(w in NAMES[1:] for w in words))
    return column.kind == "time" or (column.kind == "number" and named)


def _line(table: Table, first: Column, second: Column) -> Line | None:
    """Both columns, piece by piece."""
    line, units = Line(), None
    passes = (table.rows([], column.name, strict=False) for column in (first, second))
    for pair in zip(*passes, strict=True):
        raw = [rows.time for rows in pair]
        if len(raw[0]) != len(raw[1]):
            return None
        if len(raw[0]) == 0:
            continue
        units = units or [
            guess(column.name, one[:1000], column.unit).unit
            for column, one in zip((first, second), raw, strict=True)
        ]
        try:
            stamps = [to_ns(one, unit) for one, unit in zip(raw, units, strict=True)]
        except DataError:
            return None
        known = (stamps[0] != NO_STAMP) & (stamps[1] != NO_STAMP)
        line.add(stamps[0][known], stamps[1][known])
    return line
