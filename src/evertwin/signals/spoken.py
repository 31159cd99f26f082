"""Numbers as a person says them: millimetres rather than 0.004 m.

>>> spoken(0.0041, "m"), spoken(0.058, "rad"), spoken(12.3456, "Nm"), spoken(3e-5, "m^3/s")
('4.1 mm', '3.3°', '12 Nm', '1.8 l/min')
>>> both(0.029, 0.004, "m")
('29 mm', '4 mm')

Whoever records in bar or rpm reads of these.

>>> spoken(3200.0, "Pa", "bar"), spoken(1.5, "rad/s", "rpm"), spoken(0.3, "K", "degC")
('0.032 bar', '14 rpm', '0.3 K')
"""

from __future__ import annotations

import math

from evertwin.signals.units import conversion_of

_SMALLER = {
    "m": ((1.0, "m", 1.0), (0.1, "cm", 100.0), (0.0, "mm", 1000.0)),
    "m/s": ((1.0, "m/s", 1.0), (0.01, "cm/s", 100.0), (0.0, "mm/s", 1000.0)),
    "rad": ((0.0, "°", 180 / math.pi),),
    "rad/s": ((0.0, "°/s", 180 / math.pi),),
    "A": ((1.0, "A", 1.0), (0.0, "mA", 1000.0)),
    "Pa": ((1e5, "bar", 1e-5), (100.0, "kPa", 1e-3), (0.0, "Pa", 1.0)),
    "m^3/s": ((0.1, "m^3/s", 1.0), (0.0, "l/min", 60_000.0)),
    "V": ((1.0, "V", 1.0), (0.0, "mV", 1000.0)),
}
"""SI unit → (from this size on, unit, factor), largest first."""
MANY = 10.0
"""From this multiple on nobody counts in per cent."""
MOST, BEYOND = 1e6, 1e12
"""Multiples of a size, and sizes, of which no figure says more than a word."""
_ALIKE = {"m", "cm", "mm", "km", "m/s", "cm/s", "mm/s", "rad", "deg", "rad/s", "deg/s", "A", "mA",
          "V", "mV", "Pa", "m^3/s", "degC"}  # fmt: skip
"""Units that say no more than the one that suits a size."""


def spoken(value: float, unit: str, recorded: str = "") -> str:
    """A size with two digits, in the unit that suits it or that it is recorded in."""
    return both(value, value, unit, recorded)[0]


def both(first: float, second: float, unit: str, recorded: str = "") -> tuple[str, str]:
    """Two sizes in one unit, that of the larger one."""
    size = max((abs(v) for v in (first, second) if math.isfinite(v)), default=0.0)
    name, factor = suited(size, unit, recorded)
    space = "" if name.startswith("°") or name == "1" else " "
    return tuple(  # type: ignore[return-value]
        _wordy(value * factor) or f"{_digits(value * factor)}{space}{'' if name == '1' else name}"
        for value in (first, second)
    )


def _wordy(value: float) -> str:
    """What stands for a number that is none, or that nobody reads."""
    if math.isnan(value):
        return "unknown"
    return "" if abs(value) < BEYOND else "beyond all measure"


def number(value: float, unit: str = "", digits: int = 4) -> str:
    """A size with some digits.

    >>> number(0.00479821, "m"), number(0.25, "1"), number(1.75e36, "m"), number(math.nan)
    ('0.004798 m', '0.25', 'beyond all measure', 'unknown')
    """
    return _wordy(value) or f"{value:.{digits}g} {'' if unit == '1' else unit}".rstrip()


def percent(value: float) -> str:
    """A share of a size with two decimals; of far more than all of it in words.

    >>> percent(0.0333), percent(12.0), percent(math.inf), percent(math.nan)
    ('3.33 %', '12 times its size', 'more than a million times its size', 'unknown')
    """
    return f"{100 * value:.2f} %" if abs(value) < MANY else share(value)


def share(value: float) -> str:
    """A share of a size in per cent; as its multiple where it is far more than all of it.

    >>> share(0.0396), share(1.26), share(6100.0), share(1e30)
    ('3.96 %', '126 %', '6,100 times its size', 'more than a million times its size')
    """
    return f"{100 * value:.3g} %" if value < MANY else times(value, ",.0f")


def times(value: float, form: str = ".3g") -> str:
    """A multiple of a size; in words where nobody reads its figure."""
    if not value < MOST:
        return "unknown" if math.isnan(value) else "more than a million times its size"
    return f"{value:{form}} times its size"


def suited(size: float, unit: str, recorded: str = "") -> tuple[str, float]:
    """The unit that suits a size, and what an SI number is multiplied by."""
    if recorded == "rad/s" == unit:  # nobody who records it so thinks in degrees
        return recorded, 1.0
    told = in_recorded(unit, recorded)
    if told[0] != unit:
        return told
    steps = _SMALLER.get(unit, ((0.0, unit, 1.0),))
    return next(((name, f) for least, name, f in steps if size >= least), (unit, 1.0))


def in_recorded(unit: str, recorded: str) -> tuple[str, float]:
    """The unit that it is recorded in where that says more than SI, and what an SI number is
    multiplied by.

    >>> in_recorded("Pa", "mbar"), in_recorded("m", "mm")
    (('mbar', 0.01), ('m', 1.0))
    """
    if recorded in ("", "1", unit) or recorded in _ALIKE:
        return unit, 1.0
    return recorded, 1.0 / conversion_of(recorded)[0]


def as_recorded(unit: str, recorded: str) -> dict[str, str | float] | None:
    """The unit of the twin file in which people are told of values, its size and zero in SI, and
    that of differences; None: that of SI, or degrees, as a page has them.

    >>> as_recorded("K", "degC"), as_recorded("m", "m")
    ({'unit': 'degC', 'factor': 1.0, 'zero': 273.15, 'apart': 'K'}, None)
    """
    if recorded in ("", "1", unit) or (unit[:3] == "rad" and recorded[:3] == "deg"):
        return None
    factor, zero = conversion_of(recorded)
    apart = unit if zero and factor == 1.0 else recorded
    return {"unit": recorded, "factor": factor, "zero": zero, "apart": apart}


def _digits(value: float) -> str:
    """Two digits; whole numbers from 100 on, as far as anybody reads them."""
    return f"{value:.0f}" if 99.5 <= abs(value) < MOST else f"{value:.2g}"
