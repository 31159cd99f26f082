"""Units: SI inside, converted only at the edges.

A unit is stored with every channel and parameter. Conversion is affine (``°C`` has an offset), and
is done by `pint`; angles count as dimensionless radians.

>>> round(to_si(5.0, "cm/s"), 12), si_unit("cm/s")
(0.05, 'm/s')
>>> to_si(20.0, "degC"), si_unit("Nm")
(293.15, 'Nm')
>>> round(to_si(180.0, "grad"), 6), round(to_si(200.0, "gon"), 6)
(3.141593, 3.141593)
"""

from __future__ import annotations

import math
import re
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from evertwin.errors import UsageError
from evertwin.signals.common_units import common
from evertwin.signals.unit_text import factors, plain

if TYPE_CHECKING:
    import pint


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True, cache_folder=None)


@lru_cache(4096)
def _parse(unit: str) -> Any:
    if not unit:
        raise UsageError(
            "unit: expected a unit such as 'm/s', got none: write '1' for a pure number"
        )
    found = factors(unit)
    if found is None:
        raise _unknown(unit)
    powers: dict[str, float] = {}
    for symbol, power in found:
        name = _name(symbol, unit)
        powers[name] = powers.get(name, 0.0) + power
    alone = list(powers.values()) == [1.0]
    registry = _registry()
    units = {
        name if alone or registry._units[name].is_multiplicative else f"delta_{name}": power
        for name, power in powers.items()
        if power
    }
    return registry.Unit(registry.UnitsContainer(units))


_DEGREES = {"grad", "Grad", "grados", "gradi", "graus", "degré", "degrés"}
"""What headings call degrees. Pint's ``grad`` is the 400th part of a turn, written ``gon``."""
_TURNS = {"U", "Umdr", "rev", "revs", "tr", "giri"}
"""What headings call a turn. Pint's ``U`` is one of enzymes."""
_SPELLINGS = {
    **dict.fromkeys(_DEGREES, "degree"), **dict.fromkeys(_TURNS, "turn"),
    **dict.fromkeys(("RPM", "Upm", "UPM", "upm"), "revolutions_per_minute"),
}  # fmt: skip


_OHMS = re.compile("Ohms?$")


@lru_cache(4096)
def _name(symbol: str, unit: str) -> str:
    """What pint calls one symbol: the only text of a unit that it is given."""
    import pint

    registry = _registry()
    try:
        name = _SPELLINGS.get(symbol) or str(registry.get_name(_OHMS.sub("ohm", symbol)))
    except pint.errors.PintError:
        raise _unknown(unit) from None
    if registry._units[name].is_logarithmic:
        raise UsageError(
            f"unit: {unit!r} is logarithmic: turn the values into a linear unit first, x dB of a "
            "power into 10^(x/10), of an amplitude into 10^(x/20)"
        )
    return name


def _unknown(unit: str) -> UsageError:
    shown = unit if len(unit) <= 40 else f"{unit[:37]}..."
    return UsageError(
        f"unit: {shown!r} is not known; write it as in 'm/s', 'rad', 'Nm', 'degC', '1'"
    )


@lru_cache(4096)
def conversion(unit: str) -> tuple[float, float]:
    """(factor, offset) such that ``si = value * factor + offset``.

    Raises:
        UsageError: the unit is not known, or logarithmic.
    """
    known = common(unit)
    if known is not None:
        return known.factor, known.offset
    registry = _registry()
    parsed = _parse(unit)
    try:
        zero = float(registry.Quantity(0.0, parsed).to_base_units().magnitude)
        factor = float(registry.Quantity(1.0, parsed).to_base_units().magnitude) - zero
    except OverflowError:
        factor = math.inf
    if not (factor and math.isfinite(factor)):
        raise UsageError(f"unit: {unit!r} is too large or too small for any number")
    return factor, zero


def conversion_of(unit: str) -> tuple[float, float]:
    """`conversion`; (1, 0) of a unit that nobody gave, or that is no linear one.

    >>> conversion_of(""), conversion_of("cm")
    ((1.0, 0.0), (0.01, 0.0))
    """
    try:
        return conversion(unit) if unit else (1.0, 0.0)
    except UsageError:
        return 1.0, 0.0


_ENERGY = "kg*m^2/s^2"
"""A torque too, where its unit is made of a force."""
_NAMED = {
    "kg*m/s^2": "N", "kg/m/s^2": "Pa", "kg*m^2/s^3": "W", "kg*m^2/A/s^3": "V",
    "kg*m^2/A^2/s^3": "ohm",
}  # fmt: skip


@lru_cache(4096)
def si_unit(unit: str) -> str:
    """The SI unit that values in ``unit`` are stored in. Readable names are kept when they are SI.

    >>> si_unit("deg/s"), si_unit("1"), si_unit("mm"), si_unit("bar"), si_unit("kNm")
    ('rad/s', '1', 'm', 'Pa', 'Nm')
    """
    known = common(unit)
    if known is not None:
        return known.si
    if conversion(unit) == (1.0, 0.0):
        return plain(unit) if factors(unit) else "1"
    if "deg" in unit and compatible(unit, "degC"):
        return "K"
    base = _registry().Quantity(1.0, _parse(unit)).to_base_units().units
    name = f"{base:~C}".replace("**", "^") or "1"
    if name == _ENERGY:
        return "Nm" if re.search("N|lbf|kgf", unit) else "J"
    return _NAMED.get(name, name)


def compatible(a: str, b: str) -> bool:
    """True when the two units measure the same kind of quantity.

    >>> compatible("cm", "m"), compatible("cm", "s")
    (True, False)
    """
    one, other = common(a), common(b)
    if one is not None and other is not None:
        return one.powers | {"rad": 0} == other.powers | {"rad": 0}
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
    known = common(unit)
    if known is not None:
        return dict(known.powers)
    items = _registry().Quantity(1.0, _parse(unit)).to_base_units().unit_items()
    base = {name: float(power.real) for name, power in sorted(items)}
    if not all(power.is_integer() for power in base.values()):
        return {}
    return {_BASE[name]: int(power) for name, power in base.items() if name in _BASE}


def lacks_angle(unit: str, wanted: str) -> bool:
    """True where a rate of turning is wanted and the unit does not say what turns by it.

    ``1/min`` of a shaft counts turns, and SI alone would read radians.

    >>> lacks_angle("1/min", "rad/s"), lacks_angle("rpm", "rad/s"), lacks_angle("Hz", "1/s")
    (True, False, False)
    """
    told, asked = powers(unit), powers(wanted)
    rate = told.get("s", 0)
    return rate < 0 and told == {"s": rate} and asked == {"rad": 1, "s": rate}
