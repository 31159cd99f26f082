"""What hangs on the drive and turns with it, ``Gc·cos q + Gs·sin q``: a counterbalance, a cable.

It takes nothing out. On an arm whose bodies are tuned, gravity of the links may tell the same.
"""

from __future__ import annotations

import math

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def cosine(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """Of the position."""
    return math.cos(q)


def sine(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """Of the position."""
    return math.sin(q)


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """None over speed."""
    return 0.0


BALANCE = FrictionTerm(
    "balance",
    (
        Coefficient("Gc", "Nm", "N", cosine, slope, bias=True),
        Coefficient("Gs", "Nm", "N", sine, slope, bias=True),
    ),
    reads=("q",),
    cause="a weight hangs on it and turns with it",
)
