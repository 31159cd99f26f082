"""More Coulomb friction backwards, ``Fc_minus·min(s(v), 0)``.

Offered because recorded motion often seems to ask for it. While a drive moves it cannot be told
from an offset (see `evertwin.machines.friction.terms.direction`), so that no ladder has it; the
one-axis drive takes it as an option, and the rank over moving samples says what it is worth.
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
    always=True,
    cause="rubs more or less backwards than forwards",
)
