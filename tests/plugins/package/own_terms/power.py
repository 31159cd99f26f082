"""Friction of a lubricant that thins: ``Fp·s(v)·|v|^n``, n below 1."""

from evertwin.machines.friction import Coefficient, FrictionTerm, Shape


def feature(v, s, load, T, q, k):
    """A power of the speed."""
    return s * abs(v) ** k[0]


def slope(width, load, T, k):
    """At a speed of about the switch's width."""
    return (1.0 + k[0]) * width ** (k[0] - 1.0) if width > 0.0 else 0.0


POWER = FrictionTerm(
    "power",
    (Coefficient("Fp", "Nm", "N", feature, slope, resists=True),),
    (Shape("n", 0.6, "1", "1", low=0.1, high=1.0),),
    confused_with=("viscous", "coulomb"),
)
