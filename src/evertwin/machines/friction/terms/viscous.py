"""Viscous friction ``Fv·v``: the lubricant's resistance."""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The speed."""
    return v


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """One."""
    return 1.0


VISCOUS = FrictionTerm(
    "viscous", (Coefficient("Fv", "Nms/rad", "Ns/m", feature, slope, resists=True),), always=True
)
