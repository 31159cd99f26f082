"""A spring across the drive, ``Ks·q``; where it is at rest is in the law's offset.

It takes nothing out: what it costs one way it gives back the other.
"""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The position."""
    return q


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """None over speed."""
    return 0.0


SPRING = FrictionTerm(
    "spring",
    (Coefficient("Ks", "Nm/rad", "N/m", feature, slope, bias=True),),
    reads=("q",),
    cause="a spring pulls on it",
)
