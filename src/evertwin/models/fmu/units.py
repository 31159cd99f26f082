"""Units as FMI writes them, and what they are in SI.

An FMU may define each unit by powers of base units, a factor and an offset; where it does, that is
believed. Where it names a unit only, the name is read as Modelica writes it (``N.m``, ``rad/s``,
``kg.m2``, ``degC``). Without any, the number is taken as it is, with the unit '1'.

>>> si_of("N.m", Unit("N.m", 1.0, 0.0, (("kg", 1), ("m", 2), ("s", -2))))
('Nm', 1.0, 0.0)
>>> si_of("deg", Unit("deg", 0.017453292519943295, 0.0, (("rad", 1),)))
('rad', 0.017453292519943295, 0.0)
"""

from __future__ import annotations

from evertwin.errors import UsageError
from evertwin.models.fmu.description import Unit
from evertwin.models.unit_names import spelled
from evertwin.signals.units import compatible, conversion, si_unit


def si_of(name: str, defined: Unit | None = None) -> tuple[str, float, float]:
    """(SI unit, factor, offset) with value in SI = factor · value + offset.

    Raises:
        UsageError: the unit is not known.
    """
    if not name:
        return "1", 1.0, 0.0
    written = spelled(name)
    if defined is None or defined.exponents is None:
        return si_unit(written), *conversion(written)
    base = _powers(defined)
    try:
        known = compatible(written, base)
    except UsageError:
        known = False
    return (si_unit(written) if known else base), defined.factor, defined.offset


def _powers(unit: Unit) -> str:
    parts = [f"{base}^{power}" if power != 1 else base for base, power in unit.exponents or ()]
    return "*".join(parts) or "1"
