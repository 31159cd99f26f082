"""Numbers as a person says them: millimetres rather than 0.004 m.

>>> spoken(0.0041, "m"), spoken(0.058, "rad"), spoken(12.3456, "Nm"), spoken(3e-5, "m^3/s")
('4.1 mm', '3.3°', '12 Nm', '1.8 l/min')
>>> both(0.029, 0.004, "m")
('29 mm', '4 mm')
"""

from __future__ import annotations

import math

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


def spoken(value: float, unit: str) -> str:
    """A size with two digits, in the unit that suits it."""
    return both(value, value, unit)[0]


def both(first: float, second: float, unit: str) -> tuple[str, str]:
    """Two sizes in one unit, that of the larger one."""
    size = max((abs(v) for v in (first, second) if math.isfinite(v)), default=0.0)
    name, factor = suited(size, unit)
    space = "" if name.startswith("°") or name == "1" else " "
    return tuple(  # type: ignore[return-value]
        "unknown"
        if math.isnan(value)
        else f"{_digits(value * factor)}{space}{'' if name == '1' else name}"
        for value in (first, second)
    )


def suited(size: float, unit: str) -> tuple[str, float]:
    """The unit that suits a size, and what an SI number is multiplied by."""
    steps = _SMALLER.get(unit, ((0.0, unit, 1.0),))
    return next(((name, f) for least, name, f in steps if size >= least), (unit, 1.0))


def _digits(value: float) -> str:
    """Two digits; whole numbers from 100 on."""
    return f"{value:.0f}" if abs(value) >= 99.5 else f"{value:.2g}"
