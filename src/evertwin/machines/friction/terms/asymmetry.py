"""Coulomb friction by direction, ``Fc_back·min(s(v), 0)``.

Coulomb friction is ``Fc`` forwards and ``Fc + Fc_back`` backwards. While a drive moves this *is*
``Fc`` with ``offset`` (their sum forwards, their difference backwards): only rows at rest, where
the offset alone acts, tell them apart. Without such rows the term does not pay.
"""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The switch backwards, zero forwards."""
    return min(s, 0.0)


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """That of ``tanh(v / width)`` at rest."""
    return 1.0 / width if width > 0.0 else 0.0


ASYMMETRY = FrictionTerm(
    "asymmetry",
    (Coefficient("Fc_back", "Nm", "N", feature, slope),),
    confused_with=("coulomb", "offset"),
    cause="rubs more or less backwards than forwards",
)
