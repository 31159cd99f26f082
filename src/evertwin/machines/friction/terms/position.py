"""Dry friction that changes along the way, ``s(v)·(Fqc·cos(2π·q / wave) + Fqs·sin(2π·q / wave))``.

A gear or a screw that runs out of true rubs more at one place of each turn. ``wave`` is the way
after which it repeats: one turn of the drive, unless a twin file says otherwise.
"""

from __future__ import annotations

import math

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers, Shape


def cosine(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The switch, times the cosine of the place."""
    return s * math.cos(2.0 * math.pi * q / k[0])


def sine(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The switch, times the sine of the place."""
    return s * math.sin(2.0 * math.pi * q / k[0])


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """That of the switch."""
    return 1.0 / width if width > 0.0 else 0.0


POSITION = FrictionTerm(
    "position",
    (Coefficient("Fqc", "Nm", "N", cosine, slope), Coefficient("Fqs", "Nm", "N", sine, slope)),
    (Shape("wave", 2.0 * math.pi, "rad", "m"),),
    reads=("q",),
    confused_with=("coulomb",),
    cause="rubs more at one place of its way than at another",
)
