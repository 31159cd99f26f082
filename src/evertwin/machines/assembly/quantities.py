"""Parameters of every kind of component: names, units, bounds.

What turns counts in radians and newton metres, what slides in metres and newtons.

>>> from evertwin.machines.assembly.parts import Component
>>> [item.name for item in parameters_of(Component("motor1", "motor", 1), slides=False)]
['motor1.J', 'motor1.k', 'motor1.R', 'motor1.L']
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from evertwin.errors import UsageError, naming
from evertwin.machines.assembly.parts import Component
from evertwin.machines.friction import Law, shape_of
from evertwin.machines.friction.terms.temperature import TEMPERATURE
from evertwin.models import Parameter
from evertwin.settings.quantity import in_unit
from evertwin.signals.channels import position

HUGE = 1e9
_NONE = ("", "none")


def law_of(component: Component) -> Law | None:
    """The friction of a component, which knows no load yet; None where it has none."""
    text, temperature = (str(component.option(key)) for key in ("friction", "temperature"))
    if temperature not in ("", "input", "state"):
        raise UsageError(
            f"component {component.name!r}: expected temperature = 'input' or 'state', "
            f"got {temperature!r}"
        )
    if text in _NONE:
        return None
    with naming(f"component {component.name!r}"):
        shape = shape_of({key: component.option(key) for key in ("width", "vs", "standstill")})
        law = Law.parse(text).shaped(shape)
        if temperature:
            return law.plus(TEMPERATURE)
        return law.known_to("without temperature = 'input' or 'state'", ("load", "q"))


def _fixed(name: str, value: float, unit: str, low: float, high: float = HUGE) -> Parameter:
    """A parameter that tuning leaves alone unless the file says otherwise."""
    return Parameter(name, value, unit, low, high, editable=False)


def _rub(component: Component, slides: bool) -> list[Parameter]:
    law = law_of(component)
    if law is None:
        return []
    items = list(law.parameters(slides=slides))
    if str(component.option("temperature")) == "state":
        items += [
            _fixed("capacity", 1000.0, "J/K", 1e-6),
            _fixed("conductance", 1.0, "W/K", 0.0),
            _fixed("ambient", 293.15, "K", 1.0, 2000.0),
        ]
    return items


def _gearbox(component: Component, slides: bool) -> list[Parameter]:
    turn = slides and component.gives == "translation"
    items = [_fixed("lead", 0.01, "m", 1e-6) if turn else _fixed("ratio", 1.0, "1", 1e-6)]
    if component.kind.startswith("elastic"):
        unit = "N/m" if slides else "Nm/rad"
        items.append(_fixed("stiffness", 1e5, unit, 1e-6, 1e15))
        items.append(_fixed("damping", 10.0, "Ns/m" if slides else "Nms/rad", 0.0))
    return items + _rub(component, slides)


def transmission(box: Component) -> list[Parameter]:
    """Ratio or lead of a black box that stands between motor and joint."""
    said = {"ratio": "1", "lead": "m"}
    return [
        _fixed(name, in_unit(name, box.option(name), unit), unit, 1e-6)
        for name, unit in said.items()
        if box.option(name)
    ]


def _motor(component: Component, slides: bool) -> list[Parameter]:
    return [
        Parameter("J", 0.0, "kgm2", 0.0, HUGE),
        _fixed("k", 1.0, "Nm/A", 1e-9),
        _fixed("R", 1.0, "ohm", 1e-9),
        _fixed("L", 0.0, "H", 0.0),
    ]


def controller_items(unit: str, slides: bool) -> list[Parameter]:
    """Gains and limits of a controller that demands ``unit`` per speed, and per position for ki."""
    place = "m" if slides else "rad"
    return [
        _fixed("kp", 10.0, "1/s", 0.0),
        _fixed("kv", 1.0, f"{unit}*s/{place}", 0.0),
        _fixed("ki", 0.0, f"{unit}/{place}", 0.0),
        _fixed("feedforward", 0.0, "1", 0.0, 1.0),
        _fixed("speed_limit", HUGE, f"{place}/s", 0.0),
        _fixed("limit", HUGE, unit, 0.0),
    ]


def _structure(component: Component, slides: bool) -> list[Parameter]:
    if slides:
        return [Parameter("mass", 1.0, "kg", 1e-6, HUGE)]
    return [Parameter("inertia", 1.0, "kgm2", 1e-9, HUGE)]


def _payload(component: Component, slides: bool) -> list[Parameter]:
    unit = "kg" if slides else "kgm2"
    return [_fixed("mass" if slides else "inertia", 0.0, unit, 0.0)]


_OF: Mapping[str, Callable[[Component, bool], list[Parameter]]] = {
    "gearbox": _gearbox,
    "friction": _rub,
    "motor": _motor,
    "controller": lambda component, slides: controller_items("A", slides),
    "structure": _structure,
    "payload": _payload,
}


def parameters_of(
    component: Component, slides: bool, known: list[Parameter] | None = None
) -> list[Parameter]:
    """The parameters of a component, named ``<component>.<parameter>``, as its line starts them.

    Args:
        slides: is its axis a translation?
        known: the parameters instead of the kind's own (an arm's, a black box's).

    Raises:
        UsageError: the line gives a parameter that the component does not have.
    """
    if known is None:
        maker = _OF.get(component.role)
        known = [] if maker is None else maker(component, slides)
    names = tuple(item.name for item in known)
    for key in component.given:
        position(names, key, f"parameter or option of component {component.name!r}:")
    return [_named(component, item) for item in known]


def _named(component: Component, item: Parameter) -> Parameter:
    said = component.given.get(item.name)
    changes: dict[str, Any] = {"name": f"{component.name}.{item.name}"}
    if said is not None:
        changes |= {
            key: getattr(said, key)
            for key in ("value", "low", "high", "editable", "source")
            if getattr(said, key) is not None
        }
        if not math.isfinite(said.value):
            raise UsageError(f"{changes['name']}: expected a number, got {said.value}")
    return replace(item, **changes)
