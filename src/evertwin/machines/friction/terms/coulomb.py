"""Coulomb friction ``Fc·s(v)``: dry friction, as large at any speed."""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The switch."""
    return s


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """That of ``tanh(v / width)`` at rest."""
    return 1.0 / width if width > 0.0 else 0.0


COULOMB = FrictionTerm(
    "coulomb", (Coefficient("Fc", "Nm", "N", feature, slope, resists=True),), always=True
)
