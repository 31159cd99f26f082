"""Stamps: any column of time → int64 nanoseconds, without losing a digit.

Epoch seconds in float64 resolve 240 ns, so text is never turned into a float on its way: the
digits of ``1600362965.6889217`` are read as integers. Floats that a binary file holds are split
into whole and fractional seconds first, so that nothing more is lost than the file lost itself.

>>> import numpy as np
>>> to_ns(np.array([b"1600362965.6889217", b"-0.5", b""]), "s").tolist()[:2]
[1600362965688921700, -500000000]
>>> to_ns(np.array([b"2021-03-04T12:00:00.5+01:00"]), "iso").tolist()
[1614855600500000000]
>>> to_ns(np.array([0.1, 2.0]), "ms").tolist()
[100000, 2000000]
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import Decimal

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.sources.clocks.dates import ORDERS, date_ns, is_date, order_of, zone_of
from evertwin.types import Stamps

NO_STAMP = int(np.iinfo(np.int64).min)
"""Stands for a stamp that is empty, not a number, or beyond the years 1677 to 2262."""

UNITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Power of ten that turns one unit into nanoseconds; beside them stand the `ORDERS` of dates."""
LONG = {"min": 60, "h": 3600}
"""Seconds of the units that are no power of ten."""

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)
_LIMIT = 2**63 - 1
_DAY = 86_400 * 10**9
LONGEST = 60
"""Bytes of the longest cell that can be a stamp."""


def texts(cells: Sequence[bytes]) -> np.ndarray:
    """Cells as one array; one that is too long for a stamp is cut into what is none.

    >>> texts([b"1.5", b"1" * 70])[1][-4:]
    b'1...'
    """
    return np.array([c if len(c) <= LONGEST else c[: LONGEST - 3] + b"..." for c in cells])


def seconds_of(unit: str) -> float | None:
    """How long a unit of time is [s]; None: it is an order of dates, or unknown.

    >>> seconds_of("ms"), seconds_of("h"), seconds_of("iso")
    (0.001, 3600.0, None)
    """
    if unit in UNITS:
        return float(10.0 ** (UNITS[unit] - 9))
    return float(LONG[unit]) if unit in LONG else None


def is_decimal(unit: str) -> bool:
    """Are stamps in this unit numbers that it alone tells how to read?

    >>> is_decimal("ms"), is_decimal("iso"), is_decimal("auto")
    (True, False, False)
    """
    return unit in UNITS or unit in LONG


def to_ns(raw: np.ndarray, unit: str) -> Stamps:
    """Nanoseconds of a raw column of time; `NO_STAMP` where a cell holds none.

    Args:
        raw: bytes (text), integers, floats, datetime64 or timedelta64, (n,).
        unit: s, ms, us, ns, min, h, or one of `ORDERS`; datetime64 and timedelta64 need none.

    Raises:
        UsageError: an unknown unit.
        DataError: a text that is neither a number nor a date, with its position.
    """
    if raw.dtype.kind == "m":
        return raw.astype("timedelta64[ns]").astype(np.int64)
    if raw.dtype.kind == "M":
        day = raw.astype("datetime64[D]").astype(np.int64)
        ns = raw.astype("datetime64[ns]").astype(np.int64)
        return np.where(np.abs(day) < 106_000, ns, NO_STAMP)
    if unit in ORDERS:
        cells = (_date(bytes(cell), unit, i) for i, cell in enumerate(raw.tolist()))
        return np.array(list(cells), dtype=np.int64)
    if not is_decimal(unit):
        known = ", ".join([*UNITS, *LONG, *ORDERS])
        raise UsageError(f"time unit: expected one of {known}; got {unit!r}")
    power, seconds = UNITS.get(unit, 9), LONG.get(unit, 1)
    if raw.dtype.kind == "S" and seconds > 1:
        cells = (_decimal(bytes(cell), power, i, seconds) for i, cell in enumerate(raw.tolist()))
        return np.array(list(cells), dtype=np.int64)
    if raw.dtype.kind == "S":
        return _from_text(raw, power)
    if raw.dtype.kind in "iub":
        return _from_integers(raw, seconds * 10**power)
    return _from_floats(raw.astype(np.float64) * seconds, power)


def _from_integers(raw: np.ndarray, factor: int) -> Stamps:
    wide = raw.astype(object) if raw.dtype == np.uint64 else raw.astype(np.int64)
    fits = (wide <= _LIMIT // factor) & (wide >= -(_LIMIT // factor))
    out = np.full(len(raw), NO_STAMP, dtype=np.int64)
    keep = np.asarray(fits, dtype=np.bool_)
    out[keep] = raw[keep].astype(np.int64) * factor
    return out


def _from_floats(raw: np.ndarray, power: int) -> Stamps:
    out = np.full(len(raw), NO_STAMP, dtype=np.int64)
    keep = np.abs(raw) < _LIMIT / 10**power * 0.999  # NaN compares False
    whole = np.floor(raw[keep])
    fraction = raw[keep] - whole  # exact: both share their exponent's grid
    factor = 10**power
    out[keep] = whole.astype(np.int64) * factor + np.rint(fraction * factor).astype(np.int64)
    return out


def _from_text(raw: np.ndarray, power: int) -> Stamps:
    """Digits to integers, all rows at once; what does not look plain goes one by one."""
    if not len(raw):
        return np.zeros(0, dtype=np.int64)
    whole, _, rest = np.strings.partition(raw, b".")
    signed = np.strings.startswith(whole, b"-") | np.strings.startswith(whole, b"+")
    length, places = np.strings.str_len(whole) - signed, np.strings.str_len(rest)
    digits = np.strings.add(np.strings.lstrip(whole, b"+-"), np.strings.ljust(rest, power, b"0"))
    plain = np.strings.isdigit(digits) & (places <= power) & (length + places > 0)
    plain &= np.strings.str_len(digits) == length + power  # one sign, and no other in between
    plain &= length + power <= 18
    number = np.where(plain, digits, b"0").astype(np.int64)
    number = np.where(np.strings.startswith(whole, b"-"), -number, number)
    for i in np.flatnonzero(~plain).tolist():
        number[i] = _decimal(bytes(raw[i]), power, i)
    return number


def _decimal(cell: bytes, power: int, position: int, factor: int = 1) -> int:
    text = cell.decode("utf-8", "replace").strip()
    if text.lower() in {"", "nan", "na", "n/a", "null", "none", "inf", "-inf"}:
        return NO_STAMP
    if not _NUMBER.fullmatch(text):
        raise _not_a_stamp(text, position)
    number = (Decimal(text) * factor).scaleb(power).to_integral_value()
    return int(number) if abs(number) <= _LIMIT else NO_STAMP


def _date(cell: bytes, order: str, position: int) -> int:
    if not cell.strip():
        return NO_STAMP
    try:
        return date_ns(cell, order)
    except ValueError as error:
        raise _not_a_stamp(cell.decode("utf-8", "replace"), position, str(error)) from None


class StampError(DataError):
    """A text that is no stamp, at a position in its piece.

    >>> StampError("x", 3).position
    3
    """

    def __init__(self, message: str, position: int) -> None:
        super().__init__(message)
        self.position = position


def _not_a_stamp(text: str, position: int, reason: str = "") -> StampError:
    cell = text.encode()
    if not reason and is_date(cell):
        reason = f"set time = {{ unit = '{order_of([cell])[0]}' }}"
    return StampError(
        f"expected a stamp (a number, or a date such as 2021-03-04T12:00:00Z), got {text[:40]!r}"
        + (f": {reason}" if reason else ""),
        position,
    )


def past_midnight(t: Stamps, last: int = NO_STAMP) -> Stamps:
    """Times of day [ns] that go on over midnight: what falls by more than half a day is the next.

    Args:
        t: stamps, (n,).
        last: what the piece before ended with; `NO_STAMP` at the beginning.

    >>> past_midnight(np.array([86_399, 1]) * 10**9).tolist()
    [86399000000000, 86401000000000]
    """
    out, known = t.copy(), t != NO_STAMP
    whole = t[known]
    falls = np.diff(whole, prepend=whole[:1] if last == NO_STAMP else last % _DAY) < -_DAY // 2
    start = 0 if last == NO_STAMP else last // _DAY
    out[known] = whole + (start + np.cumsum(falls)) * _DAY
    return out


def zones(raw: np.ndarray) -> set[bool]:
    """Whether dates in ``raw`` carry a zone: {True}, {False}, or both, which cannot be meant.

    >>> sorted(zones(np.array([b"2021-03-04 12:00", b"2021-03-04 12:00Z"])))
    [False, True]
    """
    found = (zone_of(bytes(cell)) for cell in raw.tolist())
    return {bool(zone) for zone in found if zone is not None}
