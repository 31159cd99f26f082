"""Cogging of a motor: a force that repeats every turn, whatever the speed."""

import math

from evertwin.machines.friction import Coefficient, FrictionTerm


def sine(v, s, load, T, q, k):
    """Of the position."""
    return math.sin(6.0 * q)


def cosine(v, s, load, T, q, k):
    """Of the position."""
    return math.cos(6.0 * q)


def flat(width, load, T, k):
    """It does not depend on the speed."""
    return 0.0


COGGING = FrictionTerm(
    "cogging",
    (
        Coefficient("cog_sin", "Nm", "N", sine, flat, bias=True),
        Coefficient("cog_cos", "Nm", "N", cosine, flat, bias=True),
    ),
    reads=("q",),
)
