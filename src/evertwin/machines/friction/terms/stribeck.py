"""The Stribeck peak ``Fs·s(v)·exp(−(v / vs)²)``: what sticks at rest slides once it moves.

A fit may give the peak more than its share and take it from viscous and Coulomb friction: where a
recording has few slow rows, only their sum is known.
"""

from __future__ import annotations

import math

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers, Shape


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The switch, fallen to 1/e at the speed ``vs``."""
    ratio = v / k[0]
    return s * math.exp(-ratio * ratio)


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """The steeper of the switch at rest and of the fall; where one rises, the other falls."""
    fall = math.sqrt(2.0 / math.e) / k[0]
    return max(1.0 / width, fall) if width > 0.0 else fall


STRIBECK = FrictionTerm(
    "stribeck",
    (Coefficient("Fs", "Nm", "N", feature, slope, resists=True),),
    (Shape("vs", 0.2, "rad/s", "m/s"),),
    confused_with=("viscous", "coulomb"),
    cause="sticks at rest more than it slides",
)
