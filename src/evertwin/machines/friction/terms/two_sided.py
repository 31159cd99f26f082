"""More Coulomb friction backwards, ``Fc_minus·min(s(v), 0)``.

While a drive moves, Coulomb friction by direction *is* ``Fc`` with ``offset`` (their sum forwards,
their difference backwards): only rows at rest, where the offset alone acts, tell them apart.
Without such rows the term does not pay, and the rank over moving samples says what it is worth.
"""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The switch backwards, zero forwards."""
    return min(s, 0.0)


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """That of the switch."""
    return 1.0 / width if width > 0.0 else 0.0


TWO_SIDED = FrictionTerm(
    "two_sided",
    (Coefficient("Fc_minus", "Nm", "N", feature, slope),),
    confused_with=("coulomb", "offset"),
    cause="rubs more or less backwards than forwards",
)
