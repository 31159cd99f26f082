"""Viscous and Coulomb friction that change with temperature, ``(Fv_T·v + Fc_T·s(v))·(T − T0)``.

Straight lines hold over the tens of kelvin of a warm-up; over more, viscous friction falls like an
exponential (Bittencourt and Axehill, "An extended friction model to capture load and temperature
effects in robot joints", 2010).
"""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers, Shape


def viscous(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The speed, times the temperature above ``T0``."""
    return v * (T - k[0])


def coulomb(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The switch, times the temperature above ``T0``."""
    return s * (T - k[0])


def viscous_slope(width: float, load: float, T: float, k: Numbers) -> float:
    """The temperature above ``T0``, either way."""
    return abs(T - k[0])


def coulomb_slope(width: float, load: float, T: float, k: Numbers) -> float:
    """That of the switch, times the temperature above ``T0``."""
    return abs(T - k[0]) / width if width > 0.0 else 0.0


TEMPERATURE = FrictionTerm(
    "temperature",
    (
        Coefficient("Fv_T", "Nms/(rad*K)", "Ns/(m*K)", viscous, viscous_slope),
        Coefficient("Fc_T", "Nm/K", "N/K", coulomb, coulomb_slope),
    ),
    (Shape("T0", 293.15, "K", "K", 1.0, 2000.0),),
    reads=("T",),
    cause="rubs less or more as it warms",
)
