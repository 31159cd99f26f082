"""A share of the transmitted load, ``Fl·s(v)·|load|``: gears press harder where more is carried."""

from __future__ import annotations

from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Numbers


def feature(v: float, s: float, load: float, T: float, q: float, k: Numbers) -> float:
    """The size of the load, with the sign of the speed."""
    return s * abs(load)


def slope(width: float, load: float, T: float, k: Numbers) -> float:
    """That of the switch, times the load."""
    return abs(load) / width if width > 0.0 else 0.0


LOAD = FrictionTerm(
    "load",
    (Coefficient("Fl", "1", "1", feature, slope, resists=True),),
    reads=("load",),
    cause="rubs more the more it carries",
)
