"""Units: SI inside, converted only at the edges.

A unit is stored with every channel and parameter. Conversion is affine (``°C`` has an offset), and
is done by `pint`; angles count as dimensionless radians.

>>> round(to_si(5.0, "cm/s"), 12), si_unit("cm/s")
(0.05, 'm/s')
>>> to_si(20.0, "degC"), si_unit("Nm")
(293.15, 'Nm')
"""

from __future__ import annotations

import re
from functools import cache
from tokenize import TokenError
from typing import Any

import pint

from evertwin.errors import UsageError

__all__ = ["compatible", "conversion", "from_si", "powers", "si_unit", "to_si"]

_REFUSED = (
    pint.errors.PintError, ValueError, TypeError, AttributeError, AssertionError, SyntaxError,
    IndexError, KeyError, TokenError,
)  # fmt: skip
"""What pint raises for a text that is no unit."""
_SPELLINGS = {
    "kgm2": "kg*m**2", "kgm^2": "kg*m**2",
    "1": "dimensionless", "%": "percent", "°C": "degC", "°": "degree", "deg": "degree",
}  # fmt: skip
_SI = {
    "Nm": "Nm", "Nms/rad": "Nms/rad", "Nms": "Nms", "kgm2": "kgm2", "Ns/m": "Ns/m", "Nm/A": "Nm/A",
}  # fmt: skip


@cache
def _registry() -> pint.UnitRegistry[Any]:
    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True, cache_folder=None)


_POWER = r"(?:\s*(?:\*\*|\^)\s*[+-]?\d+(?:\.\d+)?|⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)?"
_FACTOR = rf"(?:[°Δ]*[^\W\d]\w*|°|%|\d+(?:\.\d+)?){_POWER}"
_PRODUCT = re.compile(rf"\s*{_FACTOR}(?:(?:\s*[*/·.]\s*|\s+){_FACTOR})*\s*")
_BRACKETS = re.compile(r"\(([^()]*)\)")


def _written(text: str) -> bool:
    """Factors with powers, one sign or space between two of them: pint passes over other signs."""
    inside = _BRACKETS.search(text)
    while inside is not None:
        if not _PRODUCT.fullmatch(inside[1]):
            return False
        text = f"{text[: inside.start()]} 1{text[inside.end() :]}"
        inside = _BRACKETS.search(text)
    return bool(_PRODUCT.fullmatch(text))


_NEWTONS = re.compile(r"([Mkcmµu]?N)(mm|ms|m|s)")
_ARMS = {"mm": "mm", "ms": "m*s", "m": "m", "s": "s"}
"""Written without a sign between, which pint takes for others: ``kNm`` for a yarn's fineness."""


def _spelt(part: str) -> str:
    """One factor as pint spells it."""
    found = _NEWTONS.fullmatch(part)
    if found is not None:
        return f"{found[1]}*{_ARMS[found[2]]}"
    return _SPELLINGS.get(part, part)


@cache
def _parse(unit: str) -> Any:
    if not unit:
        raise UsageError(
            "unit: expected a unit such as 'm/s', got none: write '1' for a pure number"
        )
    parts = unit.replace("·", "*").split("/")
    text = "/".join(_spelt(part.strip()) for part in parts)
    try:
        if not _written(text):
            raise ValueError(text)
        return _registry().Unit(text)
    except _REFUSED as error:
        raise UsageError(
            f"unit: {unit!r} is not known; write it as in 'm/s', 'rad', 'Nm', 'degC', '1'"
        ) from error


@cache
def conversion(unit: str) -> tuple[float, float]:
    """(factor, offset) such that ``si = value * factor + offset``.

    Raises:
        UsageError: the unit is not known.
    """
    registry = _registry()
    zero = registry.Quantity(0.0, _parse(unit)).to_base_units().magnitude
    one = registry.Quantity(1.0, _parse(unit)).to_base_units().magnitude
    return float(one - zero), float(zero)


@cache
def si_unit(unit: str) -> str:
    """The SI unit that values in ``unit`` are stored in. Readable names are kept when they are SI.

    >>> si_unit("deg/s"), si_unit("1"), si_unit("mm")
    ('rad/s', '1', 'm')
    """
    if conversion(unit) == (1.0, 0.0):
        return _SI.get(unit, unit)
    if "deg" in unit and compatible(unit, "degC"):
        return "K"
    base = _registry().Quantity(1.0, _parse(unit)).to_base_units().units
    return f"{base:~C}".replace("**", "^") or "1"


def compatible(a: str, b: str) -> bool:
    """True when the two units measure the same kind of quantity.

    >>> compatible("cm", "m"), compatible("cm", "s")
    (True, False)
    """
    return bool(_parse(a).dimensionality == _parse(b).dimensionality)


def to_si(value: Any, unit: str) -> Any:
    """``value`` (number or array) in SI."""
    factor, offset = conversion(unit)
    return value * factor + offset


def from_si(value: Any, unit: str) -> Any:
    """An SI ``value`` in ``unit``.

    >>> round(from_si(0.05, "cm/s"), 12), from_si(20.0, "kNm"), from_si(0.5, "Nmm")
    (5.0, 0.02, 500.0)
    """
    factor, offset = conversion(unit)
    return (value - offset) / factor


_BASE = {
    "kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "mole": "mol",
    "candela": "cd", "radian": "rad",
}  # fmt: skip


def powers(unit: str) -> dict[str, int]:
    """Powers of base units, none where one is a fraction; a plain angle keeps its radian.

    >>> powers("Nm"), powers("rad")
    ({'kg': 1, 'm': 2, 's': -2}, {'rad': 1})
    """
    items = _registry().Quantity(1.0, _parse(unit)).to_base_units().unit_items()
    base = {name: float(power.real) for name, power in sorted(items)}
    if not all(power.is_integer() for power in base.values()):
        return {}
    return {_BASE[name]: int(power) for name, power in base.items() if name in _BASE}
