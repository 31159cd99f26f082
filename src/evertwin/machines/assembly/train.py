"""Joining components: by their ports along each axis, by the structure across the axes.

Along an axis: command → controller → motor → gearbox → joint of the structure. Each passes on what
the next one takes (a command, a rotation, a translation), or the two cannot be joined and both are
named. What rubs (gearbox, guide) and what is only known as a black box sits on its axis beside
them. Across the axes the structure joins: masses that know nothing of each other, or an arm.

>>> train = join([{"name": "screw", "kind": "ballscrew", "axis": 1, "lead": 0.01},
...               {"name": "table", "kind": "mass", "axis": 1, "mass": 20.0}])
>>> train.axes[0].slides, train.parameters.names[0], [rub.name for rub in train.rubs]
(True, 'screw.lead', ['screw'])
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

from evertwin.errors import UsageError
from evertwin.machines.arm import layout
from evertwin.machines.arm.base import base_parameters
from evertwin.machines.arm.chain import Chain
from evertwin.machines.arm.model import Arm
from evertwin.machines.assembly.parts import Component, read_component
from evertwin.machines.assembly.quantities import (
    controller_items,
    law_of,
    parameters_of,
    transmission,
)
from evertwin.machines.friction import Law
from evertwin.models import Model, Parameter, Parameters

AXES = 8
"""Axes that an assembly can have."""
READS = ("position", "speed", "acceleration", "input")
"""What a black box's input may read: motion of its axis, or a channel of its own."""
Build: TypeAlias = Callable[[str, Mapping[str, Any]], Model]
"""``build(kind, options)``: the model of a black box."""


@dataclass(frozen=True)
class Axis:
    """One axis: what is joined along it.

    >>> Axis(0, True).motor is None
    True
    """

    number: int
    """From 0."""
    slides: bool
    """A translation? Else a rotation."""
    structure: Component | None = None
    """None where the axis is a joint of an arm."""
    payload: Component | None = None
    gearbox: Component | None = None
    motor: Component | None = None
    controller: Component | None = None

    @property
    def demand(self) -> str:
        """Unit of what a controller demands: motor current or voltage, motor torque, or force."""
        if self.motor is None:
            return "N" if self.slides else "Nm"
        return {"current": "A", "voltage": "V", "torque": "Nm"}[self.motor.drive]

    @property
    def elastic(self) -> bool:
        """Is there a spring between motor and joint?"""
        return self.gearbox is not None and self.gearbox.kind.startswith("elastic")


@dataclass(frozen=True)
class Rub:
    """A component that rubs.

    >>> Rub("guide", 0, Law(), False, "").temperature
    ''
    """

    name: str
    axis: int
    law: Law
    inside: bool
    """On the motor's side of a spring?"""
    temperature: str
    """``input``, ``state``, or nothing."""


@dataclass(frozen=True)
class Box:
    """A black box on an axis.

    >>> Box.__name__
    'Box'
    """

    name: str
    axis: int
    model: Model
    inputs: tuple[str, ...]
    """For each input of the model, what it reads: position, speed, acceleration or a channel."""
    output: int
    """Which output of the model is the effort."""


@dataclass(frozen=True)
class Train:
    """Components, joined. Built by `join`; see the module for an example.

    >>> Train.__name__
    'Train'
    """

    components: tuple[Component, ...]
    axes: tuple[Axis, ...]
    rubs: tuple[Rub, ...]
    boxes: tuple[Box, ...]
    parameters: Parameters
    chain: Chain | None = None
    """Of the arm, where there is one."""
    arm: Component | None = None
    base: tuple[int, ...] = ()
    """Inertial numbers of the arm that are parameters."""
    load: Component | None = None
    """Payload of the arm."""
    path: Component | None = None

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the components."""
        return tuple(component.name for component in self.components)

    @cached_property
    def first_body(self) -> int:
        """Where in ``p`` the inertial numbers of the arm begin."""
        prefix = "" if self.arm is None else f"{self.arm.name}."
        names = self.parameters.names
        return next((k for k, name in enumerate(names) if name.startswith(prefix)), -1)

    def at(self, component: Component | None, name: str) -> int:
        """Where in ``p`` a component's parameter lies; −1 where it has none."""
        if component is None or f"{component.name}.{name}" not in self.parameters.names:
            return -1
        return self.parameters.names.index(f"{component.name}.{name}")


def join(lines: Iterable[Any], build: Build | None = None) -> Train:
    """Components created one by one, then joined.

    Args:
        lines: of a file (`evertwin.machines.assembly.parts`), or components read from them.
        build: makes the model of a black box; `evertwin.machines.catalog.machine` in a twin.

    Raises:
        UsageError: two components cannot be joined, one is missing or there twice; names them.
    """
    parts = tuple(x if isinstance(x, Component) else read_component(x) for x in lines)
    names = [part.name for part in parts]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"components: expected each name once, got {name!r} twice")
    arm, path = _single(parts, "arm"), _single(parts, "path")
    chain = None if arm is None else _chain(arm)
    axes = _axes(parts, chain)
    base = _base(arm, chain, axes)
    load = next((x for x in parts if x.role == "payload"), None) if arm is not None else None
    boxes = tuple(_box(part, build) for part in parts if part.role == "box")
    items = [item for part in parts for item in _items(part, axes, chain, base, boxes)]
    rubs = tuple(rub for part in parts if (rub := _rub(part, axes)) is not None)
    return Train(parts, axes, rubs, boxes, Parameters(tuple(items)), chain, arm, base, load, path)


def _single(parts: Sequence[Component], role: str) -> Component | None:
    found = [part for part in parts if part.role == role]
    if len(found) > 1:
        both = " and ".join(repr(part.name) for part in found)
        raise UsageError(f"components: expected one {role}, got {both}")
    return found[0] if found else None


def _chain(arm: Component) -> Chain:
    """The arm's chain, from its URDF or its Denavit-Hartenberg table, as `Arm` reads them."""
    if not arm.option("urdf") and not arm.option("dh"):
        raise UsageError(
            f"component {arm.name!r}: expected urdf (a built-in name or a file) or a dh table"
        )
    more = {key: value for key, value in arm.options.items() if key not in ("urdf", "base")}
    return Arm.of(str(arm.option("urdf")), **more).chain


def _axes(parts: Sequence[Component], chain: Chain | None) -> tuple[Axis, ...]:
    structures = [part for part in parts if part.role == "structure"]
    count = chain.n if chain is not None else max((part.axis for part in structures), default=0)
    if chain is not None and structures:
        raise UsageError(f"component {structures[0].name!r}: the arm is the structure already")
    if not 0 < count <= AXES:
        raise UsageError(
            f"components: expected a structure (arm, mass or inertia) with 1 to {AXES} axes, "
            f"got {count}"
        )
    for part in parts:
        free = part.role in ("arm", "path") or (part.role == "payload" and chain is not None)
        if not free and not 1 <= part.axis <= count:
            raise UsageError(
                f"component {part.name!r}: expected axis = 1 to {count}, got {part.axis}"
            )
    return tuple(_axis(j, parts, chain) for j in range(count))


def _axis(j: int, parts: Sequence[Component], chain: Chain | None) -> Axis:
    found: dict[str, Component] = {}
    for part in parts:
        role = "gearbox" if part.transmits else part.role
        if part.axis != j + 1 or role in ("friction", "box"):
            continue
        if role in found:
            raise UsageError(
                f"component {part.name!r}: axis {j + 1} has a {role} already, {found[role].name!r}"
            )
        found[role] = part
    if chain is None and "structure" not in found:
        raise UsageError(f"axis {j + 1}: expected a mass or an inertia on it, got none")
    if chain is not None:
        slides, joint = chain.sliding[j], f"joint {chain.joints[j]!r}"
    else:
        slides, joint = found["structure"].takes == "translation", repr(found["structure"].name)
    _check_ports(found, "translation" if slides else "rotation", joint)
    found.pop("arm", None)
    return Axis(j, slides, **found)


def _check_ports(found: Mapping[str, Component], wanted: str, joint: str) -> None:
    """What the last component before the joint gives must be what the joint takes."""
    given, by = "", ""
    for role in ("controller", "motor", "gearbox"):
        part = found.get(role)
        if part is not None:
            given, by = ("rotation" if part.gives == "same" else part.gives), part.name
    if given not in ("", "command", wanted):
        hint = "a ballscrew" if wanted == "translation" else "a gearbox"
        raise UsageError(
            f"component {by!r} gives a {given}, {joint} takes a {wanted}: put {hint} between"
        )


def _base(arm: Component | None, chain: Chain | None, axes: Sequence[Axis]) -> tuple[int, ...]:
    if arm is None or chain is None or not arm.option("base"):
        return ()
    return base_parameters(chain.geometry, all(axis.motor is not None for axis in axes))


def _items(
    part: Component,
    axes: Sequence[Axis],
    chain: Chain | None,
    base: tuple[int, ...],
    boxes: Sequence[Box],
) -> list[Parameter]:
    slides = part.axis > 0 and axes[part.axis - 1].slides
    if part.role == "arm" and chain is not None:
        return parameters_of(part, False, layout.base_items(chain, base))
    if part.role == "payload" and chain is not None:
        known = [
            replace(item, name=item.name.removeprefix("payload."))
            for item in layout.payload_parameters()
        ]
        return parameters_of(part, False, known)
    if part.role == "box":
        box = next(box for box in boxes if box.name == part.name)
        return parameters_of(part, slides, [*box.model.parameters, *transmission(part)])
    if part.role == "controller":
        return parameters_of(part, slides, controller_items(axes[part.axis - 1].demand, slides))
    return parameters_of(part, slides)


def _rub(part: Component, axes: Sequence[Axis]) -> Rub | None:
    law = law_of(part) if part.role in ("gearbox", "friction") else None
    if law is None:
        return None
    inside = part.role == "gearbox" and axes[part.axis - 1].elastic
    return Rub(part.name, part.axis - 1, law, inside, str(part.option("temperature")))


def _box(part: Component, build: Build | None) -> Box:
    said = part.option("model")
    if build is None or not isinstance(said, Mapping) or "kind" not in said:
        raise UsageError(
            f"component {part.name!r}: expected model = {{ kind = …, options = … }}, got {said!r}"
        )
    model = build(str(said["kind"]), dict(said.get("options", {})))
    reads = part.option("inputs")
    for name in reads:
        model.inputs.index(name)
    missing = [name for name in model.inputs.names if name not in reads]
    if missing:
        raise UsageError(
            f"component {part.name!r}: say what its inputs read: inputs = "
            f'{{ {missing[0]} = "speed" }}; missing: {", ".join(missing)}'
        )
    for name, source in reads.items():
        if source not in READS:
            raise UsageError(
                f"component {part.name!r}: its input {name!r} can read {', '.join(READS[:-1])} or "
                f"'input' (a channel of its own), got {source!r}"
            )
    output = str(part.option("output")) or model.outputs.names[0]
    sources = tuple(str(reads[name]) for name in model.inputs.names)
    return Box(part.name, part.axis - 1, model, sources, model.outputs.index(output))
