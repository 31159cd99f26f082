"""Units of most recordings, told without Pint, whose registry takes a third of a second to load.

A product of SI units is SI as it stands; a few others stand in a table. Everything here says what
Pint says, bit for bit (a test compares them).

>>> common("Nms/rad"), common("cm/s").si
(Known(factor=1.0, offset=0.0, si='Nms/rad', powers={'kg': 1, 'm': 2, 'rad': -1, 's': -1}), 'm/s')
>>> common("inch")
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from evertwin.signals.unit_text import factors, plain

_POWERS: dict[str, dict[str, int]] = {
    **{base: {base: 1} for base in ("A", "K", "kg", "m", "rad", "s")},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"A": -1, "kg": 1, "m": 2, "s": -3},
    "Hz": {"s": -1},
}
_SCALED: dict[str, tuple[float, float, str]] = {
    "%": (0.01, 0.0, "1"),
    "cm": (0.01, 0.0, "m"), "cm/s": (0.01, 0.0, "m/s"),
    "mm": (0.001, 0.0, "m"), "mm/s": (0.001, 0.0, "m/s"),
    "deg": (math.pi / 180, 0.0, "rad"), "deg/s": (math.pi / 180, 0.0, "rad/s"),
    "kHz": (1000.0, 0.0, "1/s"),
    "ms": (0.001, 0.0, "s"), "min": (60.0, 0.0, "s"), "h": (3600.0, 0.0, "s"),
    "degC": (1.0, 273.15, "K"), "°C": (1.0, 273.15, "K"),
}  # fmt: skip


class Known(NamedTuple):
    """A unit: ``si_value = value · factor + offset`` in the unit ``si``.

    See the module for an example.
    """

    factor: float
    offset: float
    si: str
    powers: dict[str, int]
    """Of base units, and of the radian."""


@lru_cache(4096)
def common(unit: str) -> Known | None:
    """What is known of a unit; None: Pint has to be asked."""
    if unit in _SCALED:
        factor, offset, si = _SCALED[unit]
        return Known(factor, offset, si, _powers(si) or {})
    powers = _powers(unit)
    return None if powers is None else Known(1.0, 0.0, plain(unit), powers)


def _powers(unit: str) -> dict[str, int] | None:
    found: dict[str, int] = {}
    for symbol, power in factors(unit) or ((("", 0.0),) if unit != "1" else ()):
        if symbol not in _POWERS or not float(power).is_integer():
            return None
        for base, own in _POWERS[symbol].items():
            found[base] = found.get(base, 0) + own * int(power)
    return {base: power for base, power in sorted(found.items()) if power}
