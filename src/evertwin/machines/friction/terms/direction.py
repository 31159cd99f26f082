"""Viscous friction by direction, ``Fv_back·min(v, 0)``.

Viscous friction is ``Fv`` forwards and ``Fv + Fv_back`` backwards, so that a law without this term
is the same law with a zero. Coulomb friction by direction is ``two_sided``.
"""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The speed backwards, zero forwards."""
    return min(v, 0.0)


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """One."""
    return 1.0


DIRECTION = FrictionTerm(
    "direction",
    (Coefficient("Fv_back", "Nms/rad", "Ns/m", feature, slope),),
    cause="rubs more or less with speed backwards than forwards",
)
