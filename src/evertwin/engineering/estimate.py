"""Physical laws that complete missing modelling data: what makes a grey box grey.

Where no one states a parameter's value, a law may give it from what is known: a rotor's inertia
from its size and material, dry friction from the materials in contact and the force between them, a
motor's constant from its rated point. The breakdown file says so in the component's options:

    estimate = { J = { law = "cylinder", density = 7800, radius = 0.02, length = 0.05 } }

>>> found = estimate({"law": "rated", "torque": 1.2, "current": 4.0})
>>> round(found.value, 3), found.source
(0.3, 'physics: rated, torque 1.2, current 4')

Values are start values to be tuned, not measurements.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from evertwin.errors import UsageError

FRICTION: Mapping[frozenset[str], tuple[float, float]] = {
    frozenset({"steel"}): (0.15, 0.10),
    frozenset({"steel", "bronze"}): (0.18, 0.10),
    frozenset({"steel", "cast iron"}): (0.18, 0.10),
    frozenset({"steel", "PTFE"}): (0.05, 0.04),
    frozenset({"steel", "nylon"}): (0.35, 0.12),
    frozenset({"rolling"}): (0.005, 0.003),
}
"""Sliding friction coefficients of pairs of materials, dry and lubricated: the order of size that
tables of mechanical engineering give; single pairs differ by half of it."""


class Estimate(NamedTuple):
    """A value and the law that it comes from.

    >>> Estimate(1.0, "physics: cylinder").source
    'physics: cylinder'
    """

    value: float
    source: str


def _contact(said: Mapping[str, Any]) -> float:
    pair = frozenset(str(name) for name in said["materials"])
    if pair not in FRICTION:
        known = "; ".join(" on ".join(sorted(one)) for one in FRICTION)
        raise UsageError(f"contact: no coefficient for {' on '.join(sorted(pair))}; known: {known}")
    dry, wet = FRICTION[pair]
    factor = wet if said.get("lubricated", False) else dry
    return factor * float(said["normal"]) * float(said.get("radius", 1.0))


LAWS: Mapping[str, tuple[tuple[str, ...], Callable[[Mapping[str, Any]], float]]] = {
    "cylinder": (
        ("density", "radius", "length"),
        lambda s: 0.5 * math.pi * s["density"] * s["length"] * s["radius"] ** 4,
    ),
    "block": (
        ("density", "length", "width", "height"),
        lambda s: s["density"] * s["length"] * s["width"] * s["height"],
    ),
    "contact": (("materials", "normal", "lubricated", "radius"), _contact),
    "rated": (("torque", "current"), lambda s: s["torque"] / s["current"]),
    "back-EMF": (("voltage", "speed"), lambda s: s["voltage"] / s["speed"]),
    "stall": (("voltage", "current"), lambda s: s["voltage"] / s["current"]),
}
"""Laws by name, with what each needs (SI). cylinder: inertia about its axis ½·π·ρ·L·R⁴. block: its
mass. contact: dry friction μ·N, times a radius for a torque. rated: motor constant torque/current.
back-EMF: the same constant, voltage/speed. stall: winding resistance, voltage/current."""


def estimate(said: Mapping[str, Any]) -> Estimate:
    """The value that a law gives.

    Raises:
        UsageError: no such law, or it does not get what it needs.
    """
    law = str(said.get("law"))
    if law not in LAWS:
        raise UsageError(f"estimate: no law {law!r}; there are {', '.join(LAWS)}")
    needs, formula = LAWS[law]
    given = {key: value for key, value in said.items() if key != "law"}
    for key in given:
        if key not in needs:
            raise UsageError(f"estimate, law {law}: no {key!r}; it takes {', '.join(needs)}")
    try:
        value = float(formula(given))
    except KeyError as error:
        raise UsageError(f"estimate, law {law}: needs {error.args[0]}") from error
    except (TypeError, ZeroDivisionError, ValueError) as error:
        raise UsageError(f"estimate, law {law}: expected numbers other than 0: {error}") from error
    shown = ", ".join(f"{key} {_short(value)}" for key, value in given.items())
    return Estimate(value, f"physics: {law}, {shown}")


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " on ".join(str(item) for item in value)
    return f"{value:g}" if isinstance(value, int | float) else str(value)
