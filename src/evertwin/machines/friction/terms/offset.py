"""A constant ``offset``: gravity, a sensor's zero, Coulomb friction that differs by direction."""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """One."""
    return 1.0


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """Zero."""
    return 0.0


OFFSET = FrictionTerm(
    "offset", (Coefficient("offset", "Nm", "N", feature, slope, bias=True),), always=True
)
