"""Are ranges in the unit that is declared for them? Their size tells, where they tell no pose.

>>> beams = np.array([1900.0, 2400.0, 3100.0, 5200.0, 7000.0])
>>> doubted(beams, "m")
"half of the beams look longer than 2750 m, with unit = 'mm' than 2.8 m, with unit = 'cm' than 28 m"
>>> doubted(0.001 * beams, "m")
''
"""

from __future__ import annotations

import numpy as np

from evertwin.signals.units import conversion_of
from evertwin.types import Vector

LONGEST = 200.0
"""Half of a scan is not longer, whatever the lidar [m]."""
WIDE, NEAR = 60.0, 0.1
"""Half of a scan is hardly longer, or shorter [m]."""
COVERED = 1.5
"""How many times as long as the first quarter of the beams the third one is, at least, where they
see a place, and no cover."""
USUAL = 0.5, 40.0
"""Middle of the beams that a place may have [m]."""
UNITS = ("mm", "cm", "m", "in", "ft")


def middle(ranges: Vector) -> float:
    """Of those that were measured, the largest aside (it may stand for none); NaN: none [m]."""
    there = ranges[ranges < np.nanmax(ranges, initial=0.0)]
    return float(np.median(there)) if len(there) else float("nan")


def doubted(ranges: Vector, unit: str) -> str:
    """Why the ``unit`` of ranges [m, by it] is doubted, and what they are in others; empty: it is
    not."""
    half = middle(ranges)
    if not (half > WIDE or half < NEAR):
        return ""
    first, third = np.nanquantile(ranges, (0.25, 0.75))
    if half < NEAR and third < COVERED * first:
        return ""
    raw = half / conversion_of(unit)[0]
    sizes = {one: raw * conversion_of(one)[0] for one in UNITS if one != unit}
    usual = {one: size for one, size in sizes.items() if USUAL[0] < size < USUAL[1]}
    if not usual:
        return ""
    what = "longer" if half > WIDE else "shorter"
    read = ", ".join(f"with unit = '{one}' than {size:.2g} m" for one, size in usual.items())
    return f"half of the beams look {what} than {half:.4g} m, {read}"
