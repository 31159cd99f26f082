"""A quantity as it is written in a twin file: a number in SI, or text such as ``"2 cm"``.

>>> number("2 cm"), number("90 deg", "rad") == math.pi / 2, number(3.0, "s")
(0.02, True, 3.0)

A difference of temperatures has no offset:

>>> number("20 degC"), number("0.5 degC", difference=True)
(293.15, 0.5)
"""

from __future__ import annotations

import math
import re

from evertwin.errors import UsageError, naming
from evertwin.signals.units import compatible, conversion, si_unit

LONGEST = 100
"""Signs of the longest text that is read as a quantity."""
_TEXT = re.compile(
    r"\s*([+-]?(?:\d+(?:_\d+)*\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?|[+-]?inf)\s*(.*?)\s*$"
)
_TOO_LARGE = "expected a number of at most 1e308, got a larger one"


class Measured(float):
    """A number in SI that was written with a unit, and remembers how.

    It counts as any other number; whoever knows what it should measure asks `number`.

    >>> Measured(0.02, "2 cm"), Measured(0.02, "2 cm").written
    (0.02, '2 cm')
    """

    written: str

    def __new__(cls, size: float, written: str) -> Measured:
        made = super().__new__(cls, size)
        made.written = written
        return made

    def __getnewargs__(self) -> tuple[float, str]:  # type: ignore[override]
        return float(self), self.written


def written(text: str) -> tuple[float, str]:
    """The number and the unit of a text; the unit may be empty.

    Raises:
        UsageError: no number in front.

    >>> written("0.3 m"), written("-5")
    ((0.3, 'm'), (-5.0, ''))
    """
    found = _TEXT.match(text) if len(text) <= LONGEST else None
    if not found:
        shown = text if len(text) <= LONGEST else f"{text[:37]}..."
        raise UsageError(f"expected a number or text such as '2 cm', got {shown!r}")
    if found[2].startswith(","):
        raise UsageError(f"expected a decimal point, got a comma in {text!r}")
    return _finite(found[1]), found[2]


def _finite(number: str | float) -> float:
    """A number, which is infinite only where it is written so.

    Raises:
        UsageError: it is not a number, or larger than any that can be reckoned with.
    """
    try:
        size = float(number)
    except OverflowError:  # a whole number of more digits than any double
        raise UsageError(_TOO_LARGE) from None
    if math.isnan(size):
        raise UsageError("expected a number, got nan")
    if math.isinf(size) and "inf" not in str(number):
        raise UsageError(_TOO_LARGE)
    return size


def number(value: float | str, unit: str = "", *, difference: bool = False) -> float:
    """``value`` in SI.

    Args:
        value: a number, or a number with its unit as text (or read from one: `Measured`).
        unit: what is expected, any compatible unit will do; empty: any unit.
        difference: a span or spread: an offset between scales (°C, K) does not count.

    Raises:
        UsageError: no number in front, an unknown unit, or one that measures something else.
    """
    text = value.written if isinstance(value, Measured) else value
    size, used = written(text) if isinstance(text, str) else (_finite(text), "")
    if not used:
        return size
    factor, offset = conversion(used)
    if unit and not compatible(used, unit):
        raise UsageError(f"expected a quantity in '{unit}' or alike, got '{size:g} {used}'")
    return _written_digits(size, factor, 0.0 if difference else offset)


def in_unit(what: str, value: float | str, unit: str) -> float:
    """`number` in ``unit`` or alike; a message opens with ``what`` it is about.

    Raises:
        UsageError: it measures something else.

    >>> in_unit("speed", "5 cm/s", "m/s")
    0.05
    """
    with naming(what, (UsageError, TypeError, ValueError)):
        return number(value, unit)


def own(what: str, value: float, unit: str, *, difference: bool = False) -> float:
    """A number in ``unit`` itself, not in SI: converted where it was written with a unit.

    Raises:
        UsageError: it measures something else.

    >>> own("a", Measured(20_000.0, "200 mbar"), "bar"), own("a", 0.2, "bar")
    (0.2, 0.2)
    """
    if not isinstance(value, Measured):
        return value
    size, used = written(value.written)
    if used == unit:
        return size
    with naming(what, (UsageError, TypeError, ValueError)):
        si = number(value, unit, difference=difference)
    factor, offset = conversion(unit)
    return _written_digits(si, 1.0 / factor, 0.0 if difference else -offset / factor)


def _written_digits(size: float, factor: float, offset: float) -> float:
    """5 cm is 0.05 m, not 0.050000000000000003: take the short number where both mean the same."""
    si = size * factor + offset
    if math.isinf(si):
        if math.isfinite(size):
            raise UsageError(_TOO_LARGE)
        return si
    short = float(f"{si:.14g}")
    return short if abs(short - si) <= 4e-16 * max(abs(si), abs(offset)) else si


def as_number(text: str) -> float | str:
    """SI (`Measured`) if ``text`` is a number with a known unit, else the text itself.

    >>> as_number("30 cm"), as_number("6 axes"), as_number("ur5"), as_number("5")
    (0.3, '6 axes', 'ur5', '5')
    """
    found = _TEXT.match(text) if len(text) <= LONGEST else None
    if not found or not found[2]:
        return text
    try:
        si_unit(found[2])
    except UsageError:
        return text
    return Measured(number(text), text)
