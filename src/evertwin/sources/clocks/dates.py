"""Dates and times of day as loggers and spreadsheets write them → nanoseconds.

A year of four digits that comes first, or a month by its name, can be read in one way only (unit
``iso``). Of ``03/04/2025`` it takes a row with a number above 12 to say which one is the day
(``dmy``, ``mdy``); a column without such a row is unclear. A time without a date (``clock``) has
seconds, or says AM or PM: ``08:15`` alone could be minutes and seconds. A zone is Z, UTC, GMT, CET,
CEST or an offset; without one a date counts as UTC.

>>> order_of([b"03/04/2025 08:00", b"13/04/2025 08:00"]), order_of([b"03/04/2025 08:00"])
(('dmy', True), ('dmy', False))
>>> date_ns(b"13.01.2025 08:00:00,5", "dmy") == date_ns(b"2025-01-13T09:00:00.5+01:00", "iso")
True
>>> date_ns(b"1:00:02 PM", "clock") // 10**9
46802
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np

ORDERS = ("iso", "dmy", "mdy", "clock")
"""Units of a column whose stamps are no numbers."""
_MONTHS = (b"jan", b"feb", b"mar", b"apr", b"may", b"jun", b"jul", b"aug", b"sep", b"oct", b"nov",
           b"dec")  # fmt: skip
_DAY = rb"""(?:
    (?P<year>\d{4})[-./](?P<month>\d\d?)[-./](?P<day>\d\d?)
  | (?P<one>\d\d?)(?P<sign>[-./])(?P<two>\d\d?)(?P=sign)(?P<end>\d{4})
  | (?P<dotted>\d\d?)\.(?P<moon>\d\d?)\.(?P<short>\d\d)(?=[ ,T])  # of this century
  | (?P<date>\d\d?)[-.\ ]{1,2}(?P<name>%s)[a-z]*[-.,\ ]{1,2}(?P<told>\d{4}|\d\d(?=[ ,T]))
)""" % b"|".join(_MONTHS)
_HOUR = rb"""(?P<hour>\d{1,4})%b(?P<minute>\d\d)(?:%b(?P<second>\d\d)(?:[:.,](?P<part>\d+))?)?
    (?:\s*(?P<half>[ap])\.?m\.?)?"""
_ZONE = rb"\s*(?P<zone>Z|UTC|GMT|CET|CEST|[+-]\d\d:?(?:\d\d)?)?(?:\[[\w/]+\])?"
_FLAGS = re.VERBOSE | re.IGNORECASE
_DATE = re.compile(
    rb"\s*%b(?:(?:[T._]|,?\ {1,2})%b%b)?\s*" % (_DAY, _HOUR % (b"[:.]", b"[:.]"), _ZONE), _FLAGS
)
_CLOCK = re.compile(rb"\s*(?:(?P<days>\d+)\ days?,?\ )?%b\s*" % _HOUR % (b":", b":"), _FLAGS)
_CELLS = frozenset(b";,|\t")
"""What parts the cells of a row."""
_OFFSETS = {b"": 0, b"Z": 0, b"UTC": 0, b"GMT": 0, b"CET": 3600, b"CEST": 7200}


def is_date(cell: bytes) -> bool:
    """Is it meant as a date, or as a time of day? A zone may stand behind it, but no more cells.

    >>> [is_date(c) for c in (b"13.01.2025", b"08:15:00", b"08:15", b"13.01", b"10.0.12")]
    [True, True, True, False, False]
    >>> is_date(b"08:15:00 EST"), is_date(b"08:15:00;1,5;AUTO")
    (True, False)
    """
    begun = (kind.match(cell) for kind in (_DATE, _CLOCK))
    return any(_CELLS.isdisjoint(cell[found.end() :]) for found in begun if found is not None)


_ALONE = re.compile(rb"\d{1,2}:\d\d(?::\d\d(?:[.,]\d+)?)?(?:\s*[ap]\.?m\.?)?", re.IGNORECASE)
"""A time of day, of which a date beside it says that it is one."""


def beside(columns: Sequence[Sequence[bytes]]) -> tuple[int, int] | None:
    """The one column of dates without a time of day and the one of times, if there are both; some
    cells of each column are enough, the empty ones left out.

    >>> beside([[b"2025-01-13"], [b"7.5"], [b"08:15"]]), beside([[b"2025-01-13 08:00"], [b"08:15"]])
    ((0, 2), None)
    """
    days = [k for k, cells in enumerate(columns) if cells and all(map(_is_day, cells))]
    times = [k for k, cells in enumerate(columns) if cells and all(map(_ALONE.fullmatch, cells))]
    return (days[0], times[0]) if len(days) == len(times) == 1 else None


def _is_day(cell: bytes) -> bool:
    found = _DATE.fullmatch(cell)
    return found is not None and found["hour"] is None


def is_whole(cell: bytes) -> bool:
    """Is it a date with a time of day?

    >>> is_whole(b"13.01.2025 08:15"), is_whole(b"13.01.2025"), is_whole(b"08:15:00")
    (True, False, False)
    """
    found = _DATE.fullmatch(cell)
    return found is not None and found["hour"] is not None


def order_of(cells: Iterable[bytes]) -> tuple[str, bool]:
    """One of `ORDERS` and whether the cells say so; empty where none of them is a date."""
    order = ""
    for cell in cells:
        found = _DATE.match(cell)
        if found is None:
            order = order or ("clock" if _CLOCK.match(cell) else "")
        elif found["one"] is None and found["dotted"] is None:
            return "iso", True
        else:
            order = "dmy"
            if int(found["one"] or found["dotted"]) > 12:
                return "dmy", True
            if int(found["two"] or found["moon"]) > 12:
                return "mdy", True
    return order, order != "dmy"


def zone_of(cell: bytes) -> bytes | None:
    """The zone of a date, empty for none; None where the cell is no date with a time."""
    found = _DATE.fullmatch(cell)
    return None if found is None or found["hour"] is None else found["zone"] or b""


def date_ns(cell: bytes, order: str) -> int:
    """Nanoseconds since 1970, of a time of day since midnight.

    Args:
        cell: text.
        order: one of `ORDERS`.

    Raises:
        ValueError: it is none of this order, with the reason where one can be told.
    """
    clock = order == "clock"
    found = (_CLOCK if clock else _DATE).fullmatch(cell)
    if found is None:
        begun = None if clock else _DATE.match(cell)
        hint = "a zone is Z, UTC, GMT, CET, CEST, or an offset such as +01:00"
        raise ValueError(hint if begun and begun["hour"] else "")
    if clock and not (found["second"] or found["half"]):
        raise ValueError("hours and minutes, or minutes and seconds? Write all three")
    days = int(found["days"] or 0) if clock else _days(found, order)
    hour, minute, second = (int(found[k] or 0) for k in ("hour", "minute", "second"))
    if found["half"]:
        if not 1 <= hour <= 12:
            raise ValueError("AM and PM go with hours from 1 to 12")
        hour = hour % 12 + 12 * (found["half"].lower() == b"p")
    if minute > 59 or second > 60 or (hour > 24 and not clock):
        raise ValueError("no such time of day")
    zone = b"" if clock else (found["zone"] or b"").upper()
    seconds = days * 86400 + hour * 3600 + minute * 60 + second - _offset(zone)
    return seconds * 10**9 + int((found["part"] or b"0")[:9].ljust(9, b"0"))


def _days(found: re.Match[bytes], order: str) -> int:
    """Days since 1970.

    Raises:
        ValueError: no such day, none of this order, or beyond what nanoseconds count.
    """
    if found["year"]:
        year, month, day = (int(found[k]) for k in ("year", "month", "day"))
    elif found["name"]:
        year, day = int(found["told"]), int(found["date"])
        year += 2000 * (year < 100)  # of this century, as DATE-MON-YY of historians is
        month = 1 + _MONTHS.index(found["name"].lower())
    elif order in ("dmy", "mdy"):
        year = int(found["end"] or 2000 + int(found["short"]))
        parts = int(found["one"] or found["dotted"]), int(found["two"] or found["moon"])
        day, month = parts if order == "dmy" else parts[::-1]
    else:
        raise ValueError("which of its numbers is the day? Set time = { unit = 'dmy' or 'mdy' }")
    try:
        day_of = np.datetime64(f"{year:04d}-{month:02d}-{day:02d}", "D")
    except ValueError:
        raise ValueError("no such day") from None
    if not 1678 <= year <= 2261:
        raise ValueError("expected a year from 1678 to 2261")
    return int(day_of.astype(np.int64))


def _offset(zone: bytes) -> int:
    """Of a zone from UTC [s]."""
    if zone in _OFFSETS:
        return _OFFSETS[zone]
    digits = zone[1:].replace(b":", b"")
    offset = int(digits[:2]) * 3600 + int(digits[2:] or 0) * 60
    return -offset if zone[:1] == b"-" else offset
