"""The lubricant film ``Fr·s(v)·√|v|``: friction that grows ever slower with speed."""

from __future__ import annotations

import math

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The root of the speed, with its sign."""
    return s * math.sqrt(abs(v))


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """The largest slope of tanh(x)·√x is 0.9; a sign's has no bound, and steps have a last one."""
    return 0.9 / math.sqrt(width) if width > 0.0 else 0.0


ROOT = FrictionTerm(
    "root",
    (Coefficient("Fr", "N*m*s**0.5", "N*s**0.5/m**0.5", feature, slope, resists=True),),
    confused_with=("viscous", "coulomb"),
    cause="a lubricant's film grows with speed",
)
