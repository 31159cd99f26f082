"""A machine broken down: systems, sub-systems, components; what is known of each, what wears it.

The breakdown file (TOML) is written by who knows the machine. It says nothing about code: which
model is made of it, how deeply and what is tuned is proposed from it; whatever the engineer wants
otherwise is an ``override`` with its reason, in the same file.

>>> found = BREAKDOWN.parse('''
... schema = 1
... name = "pump"
... [[system]]
... name = "hydraulic"
... [[system.component]]
... name = "seal"
... effect = 5
... proneness = 4
... ''')
>>> [(place.system, place.component.name) for place in found.places]
[('hydraulic', 'seal')]

What holds of several components alike is said once, under ``[like.NAME]``; a component with
``like = "NAME"`` says only what differs.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Le

from evertwin.engineering.parts import Component, ModelPart, ParameterPart, Requirements, Sensor
from evertwin.errors import UsageError, nearest
from evertwin.settings.form import Form
from evertwin.settings.kinds import Duration
from evertwin.settings.notes import Free, Hidden, Path, PlacedError
from evertwin.settings.section import Section
from evertwin.types import Json

SCHEMA = 1
"""Version of the breakdown file that this evertwin reads."""


@dataclass(frozen=True)
class Subsystem(Section):
    """``[[system.subsystem]]``: a part of a system, such as one axis.

    >>> Subsystem("axis 1").component
    ()
    """

    name: str
    """Name of the sub-system."""
    component: tuple[Component, ...] = ()
    """Its components."""


@dataclass(frozen=True)
class System(Section):
    """``[[system]]``: a system of the machine, such as the mechanical one.

    >>> System("mechanical").subsystem
    ()
    """

    name: str
    """Name of the system."""
    about: str = ""
    """What it does."""
    subsystem: tuple[Subsystem, ...] = ()
    """Its sub-systems."""
    component: tuple[Component, ...] = ()
    """Components that belong to no sub-system."""


class Place(NamedTuple):
    """A component and where it stands.

    >>> Place._fields
    ('system', 'subsystem', 'component')
    """

    system: str
    subsystem: str
    """Empty: of the system itself."""
    component: Component


class Stated(NamedTuple):
    """What the file says of a parameter.

    >>> Stated("motor.J", Component("motor"), ParameterPart(), 0.0).name
    'motor.J'
    """

    name: str
    """As the model calls it."""
    component: Component
    said: ParameterPart
    drift: float
    """By wear, a year."""


@dataclass(frozen=True)
class Breakdown(Section):
    """A whole breakdown file.

    >>> Breakdown("pump").components
    ()
    """

    name: str
    """Name of the machine; the twin is called the same."""
    schema: int = SCHEMA
    """Version of the file's form."""
    about: str = ""
    """What machine it is."""
    study: tuple[str, ...] = ()
    """Systems that the study looks at; components of others are left out. Absent: all."""
    history: str | None = None
    """Maintenance history (CSV: ``date``, ``component``, ``downtime [h]``), relative to this file;
    proneness to failure is computed from it where no grade is given."""
    history_span: Duration | None = None
    """Time that the history covers; absent: from its first entry to its last."""
    critical_from: Annotated[float, Ge(1.0), Le(25.0)] = 10.0
    """Effect × proneness from which a component is critical."""
    model: ModelPart = ModelPart()
    """How the components make up the model."""
    requirements: Requirements = Requirements()
    """What the twin has to reach."""
    sensors: Mapping[str, Sensor] = field(default_factory=dict)
    """Sensors by the name of their channel."""
    like: Annotated[Mapping[str, Json], Free(raw=True)] = field(default_factory=dict)
    """What holds of several components alike, by a name of your choice: settings of a component."""
    system: tuple[System, ...] = ()
    """The systems, one ``[[system]]`` each."""
    twin: Annotated[Mapping[str, Json], Free(raw=True)] = field(default_factory=dict)
    """Sections of the twin file that this file decides: ``[[twin.source]]``, ``[twin.clock]`` …"""
    folder: Annotated[str, Hidden()] = field(default=".", compare=False)
    """Folder of the file; set when it is read."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for k, system in enumerate(self.study):
            if system not in {s.name for s in self.system}:
                raise PlacedError(f"study: no system {system!r} in this file", ("study", k))
        names: set[str] = set()
        for path, place in self.placed():
            component = place.component
            if component.name in names:
                said = f"expected each component's name once, got {component.name!r} twice"
                raise PlacedError(said, (*path, "name"))
            names.add(component.name)
            for k, sensor in enumerate(component.sensors):
                if sensor not in self.sensors:
                    said = f"component {component.name!r}: no [sensors.{sensor}] in this file"
                    raise PlacedError(said, (*path, "sensors", k))

    @classmethod
    def prepare(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        """The table with every component completed by what it is ``like``."""
        shared = table.get("like", {})
        if not isinstance(shared, Mapping) or not isinstance(table.get("system"), list):
            return table
        for name, below in shared.items():
            if isinstance(below, Mapping) and "like" in below:
                said = f"[like.{name}] is like nothing else: write its settings out here"
                raise PlacedError(said, ("like", name, "like"))
        systems = [_completed(s, shared, ("system", k)) for k, s in enumerate(table["system"])]
        return {**table, "system": systems}

    @classmethod
    def written(cls, table: Mapping[str, Any], path: Path) -> Path:
        """At the component, or at what it is ``like``: where more of ``path`` is found."""
        shared: Any = table.get("like")
        if not isinstance(shared, Mapping):
            return path
        node: Any = table
        for depth, step in enumerate(path):
            name = node.get("like") if isinstance(node, Mapping) else None
            if isinstance(name, str) and isinstance(shared.get(name), Mapping):
                rest = path[depth:]
                if _reached(shared[name], rest) > _reached(node, rest):
                    return ("like", name, *rest)
            if not _has(node, step):
                break
            node = node[step]
        return path

    @property
    def places(self) -> tuple[Place, ...]:
        """Every component with its system and sub-system, in the file's order."""
        return tuple(place for _, place in self.placed())

    def placed(self) -> Iterator[tuple[Path, Place]]:
        """Every component, with the path of its table in the file."""
        for s, system in enumerate(self.system):
            for c, component in enumerate(system.component):
                yield ("system", s, "component", c), Place(system.name, "", component)
            for u, part in enumerate(system.subsystem):
                for c, component in enumerate(part.component):
                    at = ("system", s, "subsystem", u, "component", c)
                    yield at, Place(system.name, part.name, component)

    @property
    def components(self) -> tuple[Component, ...]:
        """Every component, in the file's order."""
        return tuple(place.component for place in self.places)

    @property
    def studied(self) -> tuple[Place, ...]:
        """The components that the study looks at."""
        return tuple(p for p in self.places if not self.study or p.system in self.study)

    @property
    def stated(self) -> tuple[Stated, ...]:
        """The parameters of the study's components."""
        return tuple(
            Stated(self.parameter_name(part, local), part, said, part.drift(local))
            for part in (place.component for place in self.studied)
            for local, said in part.parameters.items()
        )

    def component(self, name: str) -> Component:
        """One component.

        Raises:
            UsageError: there is none of this name.
        """
        for component in self.components:
            if component.name == name:
                return component
        raise UsageError(f"{self.name}: no component {name!r}")

    def parameter_name(self, component: Component, name: str) -> str:
        """What the model calls a component's parameter.

                >>> from annotated_types import Ge, Le

        from evertwin.engineering.parts import ModelPart
                >>> arm = Breakdown("arm", model=ModelPart("arm", names="{parameter}{axis}"))
                >>> arm.parameter_name(Component("gearbox 1", axis=1), "Fc")
                'Fc1'
        """
        return self.model.names.format(
            component=component.name, parameter=name, axis=component.axis
        )


def _completed(table: Any, shared: Mapping[str, Any], path: Path) -> Any:
    """A system, sub-system or component, with what its components are like."""
    if not isinstance(table, Mapping):
        return table
    out = dict(table)
    for key in ("subsystem", "component"):
        if isinstance(out.get(key), list):
            out[key] = [_completed(one, shared, (*path, key, k)) for k, one in enumerate(out[key])]
    name = out.get("like")
    if not isinstance(name, str):
        return out
    if not isinstance(shared.get(name), Mapping):
        said = f"like = {name!r}: there is no [like.{name}], {nearest(name, shared)}"
        raise PlacedError(said, (*path, "like"))
    return _merged(shared[name], out)


def _has(node: Any, step: str | int) -> bool:
    """Is there something at ``step`` of a table or array?"""
    if isinstance(node, list):
        return isinstance(step, int) and step < len(node)
    return isinstance(node, Mapping) and step in node


def _reached(node: Any, path: Path) -> int:
    """How many steps of ``path`` lead somewhere."""
    for depth, step in enumerate(path):
        if not _has(node, step):
            return depth
        node = node[step]
    return len(path)


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """``above`` laid over ``below``, table by table."""
    out = dict(below)
    for key, value in above.items():
        old = out.get(key)
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            out[key] = _merged(old, value)
        else:
            out[key] = _short(old, value)
    return out


def _short(old: Any, value: Any) -> Any:
    """A bare number over a parameter's table is its value."""
    number = isinstance(value, int | float | str) and not isinstance(value, bool)
    return {**old, "value": value} if isinstance(old, Mapping) and number else value


_ABOUT = """# The breakdown file

A breakdown file is TOML: machine → systems → sub-systems → components, and what is known of each.
`evertwin engineer` makes a twin file of it. A quantity is a number in SI, or text with its unit
(`"400 ms"`, `"30 %"`). What holds of several components alike is said once, under `[like.NAME]`; a
component with `like = "NAME"` says only what differs. An unknown key is an error that names the
nearest one and its line.

Grades go from 1 to 5. Effect on the machine's health: 1 none, 2 little, 3 quality suffers, 4 the
machine runs badly, 5 it stops. Proneness to failure: 1 never, 2 once in its life, 3 every few
years, 4 every year, 5 more often. Where no grade is given it is computed from the maintenance
history, a CSV with the columns `date`, `component` and `downtime [h]`.

The JSON schema for editors comes from `evertwin schema --breakdown`.
"""

BREAKDOWN = Form(Breakdown, SCHEMA, "breakdown file", _ABOUT)
"""How breakdown files are read."""


def read_breakdown(path: str | pathlib.Path) -> Breakdown:
    """The breakdown file at ``path``.

    Raises:
        ConfigError: the file cannot be read, or does not say what it must; the message has one line
            for each problem, ``file:line: what was expected, what came``.
    """
    found = BREAKDOWN.parse(BREAKDOWN.load(path), str(path))
    return dataclasses.replace(found, folder=str(pathlib.Path(path).resolve().parent))
