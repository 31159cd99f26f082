"""Which unit a column of time is in, when nobody says.

The heading decides if it states a unit; then the size of the numbers, because stamps counted from
1970 lie in another decade for each unit; then the spacing. Whole numbers that advance by ten or
more a row could be seconds or milliseconds: that is said, and must be answered in the twin file.

>>> import numpy as np
>>> guess("t", np.array([1614859007119846022, 1614859010160238574])).unit
'ns'
>>> guess("time_ms", np.array([0.0, 20.0])).unit
'ms'
>>> guess("t", np.array([0, 20, 40])).sure
False
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from evertwin.sources.stamps import NO_STAMP, to_ns
from evertwin.sources.table import Column, Table

_HINTS = {
    "ns": {"ns", "nsec", "nanos", "nanosec", "nanosecond", "nanoseconds"},
    "us": {"us", "µs", "usec", "micros", "microsecond", "microseconds"},
    "ms": {"ms", "msec", "millis", "millisecond", "milliseconds"},
    "s": {"s", "sec", "secs", "second", "seconds"},
}
_STATED, _EPOCH = "stated in the heading", "counted from 1970"
_DATE = re.compile(rb"\s*\d{4}[-./]\d\d?[-./]\d")
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$")
_FIRST, _LAST = 946_684_800, 4_102_444_800
"""The years 2000 and 2100 [s]."""


class TimeGuess(NamedTuple):
    """A unit of time, why, and whether it can be relied on.

    >>> TimeGuess("s", "heading", True).sure
    True
    """

    unit: str
    reason: str
    sure: bool

    @property
    def evident(self) -> bool:
        """Whether the file says it, or the years since 1970 do."""
        return self.reason in (_STATED, _EPOCH)


def guess(heading: str, raw: np.ndarray, stated: str = "") -> TimeGuess:
    """The unit of a raw column of time.

    Args:
        heading: the column's name.
        raw: some rows of it, (n,).
        stated: unit that the file itself states, empty if none.
    """
    if raw.dtype.kind == "M":
        return TimeGuess("iso", "calendar stamps", True)
    if raw.dtype.kind == "S" and any(_DATE.match(cell) for cell in _texts(raw)):
        return TimeGuess("iso", "dates", True)
    words = {stated.lower(), *re.split(r"[^a-zµ]+", heading.lower())}
    for unit, hints in _HINTS.items():
        if words & hints:
            return TimeGuess(unit, _STATED, True)
    if raw.dtype.kind == "S":
        raw = raw[np.array([_NUMBER.match(cell) is not None for cell in raw.tolist()], np.bool_)]
    stamps = to_ns(raw, "ns" if _whole(raw) else "s")
    stamps = stamps[stamps != NO_STAMP]
    if len(stamps) == 0:
        return TimeGuess("s", "no stamp to tell it by", False)
    return _by_size(stamps, _whole(raw))


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
    step = float(np.median(np.abs(np.diff(stamps)))) if len(stamps) > 1 else 0.0
    step /= 1 if whole else 1e9
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        seconds = step / factor
        if _FIRST * factor <= number < _LAST * factor and seconds < 86_400 * 31:
            return TimeGuess(unit, _EPOCH, True)
    if whole and step >= 10:
        unit = "ms" if step < 1e4 else "us" if step < 1e6 else "ns"
        return TimeGuess(unit, f"whole numbers that advance by {step:g} a row", False)
    return TimeGuess("s", f"advances by {step:g} a row", True)


NAMES = ("t", "time", "timestamp", "stamp", "times", "datetime", "date", "zeit", "seconds", "secs")
"""Usual first words of a column of time."""


def time_column(table: Table) -> Column | None:
    """The column that holds the stamps: by its kind, its name, or first and increasing.

    A bag's own stamps come first; then calendar stamps; then usual names; then the first column,
    if it is a number and grows all through the first rows while others do not.
    """
    columns = table.columns
    for column in columns:
        if column.kind == "time":
            return column
    for column in columns:
        every = (re.split(r"[^a-z]+", name.lower().strip()) for name in (column.name, *column.also))
        if column.kind == "number" and any(words[0] in NAMES for words in every):
            return column
    numeric = [c.name for c in columns if c.kind == "number"]
    if len(numeric) < 2 or columns[0].name != numeric[0]:
        return None
    rows = next(iter(table.rows(numeric, None, strict=False)), None)
    if rows is None or len(rows.line) < 3:
        return None
    steps = np.diff(rows.values[:100, 0])
    return columns[0] if bool((steps >= 0).all() and (steps > 0).mean() > 0.5) else None
