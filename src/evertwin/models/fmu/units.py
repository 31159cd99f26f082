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

import re

from evertwin.errors import UsageError
from evertwin.models.fmu.description import Unit
from evertwin.signals.units import compatible, conversion, si_unit

_READABLE = {"N.m": "Nm", "N.m.s/rad": "Nms/rad", "kg.m2": "kgm2", "N.s/m": "Ns/m", "N.m/A": "Nm/A"}


def si_of(name: str, defined: Unit | None = None) -> tuple[str, float, float]:
    """(SI unit, factor, offset) with value in SI = factor · value + offset.

    Raises:
        UsageError: the unit is not known.
    """
    if not name:
        return "1", 1.0, 0.0
    spelled = _READABLE.get(name) or _spelled(name)
    if defined is None or defined.exponents is None:
        return si_unit(spelled), *conversion(spelled)
    base = _powers(defined)
    try:
        known = compatible(spelled, base)
    except UsageError:
        known = False
    return (si_unit(spelled) if known else base), defined.factor, defined.offset


def _spelled(name: str) -> str:
    """``kg.m2/(s.K)`` as ``kg*m^2/(s*K)``."""
    text = re.sub(r"([A-Za-z])(-?\d+)", r"\1^\2", name)
    return re.sub(r"\.(?=[A-Za-z(])", "*", text)


def _powers(unit: Unit) -> str:
    parts = [f"{base}^{power}" if power != 1 else base for base, power in unit.exponents or ()]
    return "*".join(parts) or "1"
