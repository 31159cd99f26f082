"""From a breakdown to a model: every component at its level, joined, as plain data.

* **white**: the component as its line says, with the values that are stated.
* **grey**: the same; what is not stated is completed by a physical law
  (`estimate`) or starts at the model's own value; its source says which.
* **black**: nothing inside is modelled. A gearbox only transmits, a guide is left out (the rest
  takes its friction), a motor, a structure, a payload is lumped: as described, and not tuned. A
  ``black_box`` is another model and stays what it is.

>>> from evertwin.engineering.breakdown import BREAKDOWN
>>> found = BREAKDOWN.parse('''
... schema = 1
... name = "axis"
... [[system]]
... name = "mechanical"
... [[system.component]]
... name = "guide"
... kind = "guide"
... axis = 1
... proneness = 4
... parameters = { Fc = { value = 20, source = "literature" } }
... [[system.component]]
... name = "table"
... kind = "mass"
... axis = 1
... proneness = 1
... parameters = { mass = 95 }
... ''')
>>> plan = compile_model(found, {"guide": "white", "table": "black"})
>>> plan.kind, plan.parameters["guide.Fc"], plan.parameters["table.mass"]["editable"]
('assembly', {'value': 20.0, 'source': 'literature'}, False)

Physical laws that complete missing modelling data: what makes a grey box grey.

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
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from evertwin.engineering.breakdown import Breakdown
from evertwin.engineering.criticality import history_of, rank
from evertwin.engineering.level import level_of
from evertwin.engineering.parts import Component, Level, ParameterPart
from evertwin.errors import ConfigError, UsageError, naming
from evertwin.machines.assembly import KINDS, join, sensors_of
from evertwin.machines.catalog import located, machine
from evertwin.models import Model
from evertwin.settings.document import Document
from evertwin.types import Json

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


_NAMED = re.compile(r"component '([^']+)'")


class Built(NamedTuple):
    """What became of one component.

    >>> Built("guide", "black", "left out", "of no interest").made
    'left out'
    """

    component: str
    level: Level
    made: str
    """The kind it became, with what that means."""
    reason: str


@dataclass(frozen=True)
class ModelPlan:
    """A model as plain data: ``[model]`` of a twin file.

    >>> ModelPlan("thermal", {}, {}).built
    ()
    """

    kind: str
    options: Mapping[str, Json]
    parameters: Mapping[str, Mapping[str, Json]]
    """Start values (SI), bounds, sources, editable or not, by the model's names."""
    built: tuple[Built, ...] = ()

    def model(self, folder: str | Path = ".") -> Model:
        """The model itself, without the parameters' settings; files are relative to ``folder``."""
        return machine(self.kind, located(folder, self.options))


def levels_of(breakdown: Breakdown) -> dict[str, Level]:
    """Level of every studied component: recommended, or as the engineer overrides it."""
    found = rank(breakdown, history_of(breakdown))
    return {
        one.component: level_of(breakdown.component(one.component), one.role).level for one in found
    }


def compile_model(
    breakdown: Breakdown, levels: Mapping[str, Level] | None = None, file: str | Path | None = None
) -> ModelPlan:
    """The model that a breakdown describes.

    Args:
        levels: of the components; by default recommended and overridden as the file says.
        file: where the breakdown was read from: messages then say the line.

    Raises:
        ConfigError: the components do not make a model; names the component and its line.
    """
    levels = levels_of(breakdown) if levels is None else levels
    try:
        return _compiled(breakdown, levels)
    except ConfigError:
        raise
    except UsageError as error:
        raise ConfigError(_located(str(error), breakdown, file)) from error


def _compiled(breakdown: Breakdown, levels: Mapping[str, Level]) -> ModelPlan:
    parts = [
        place.component
        for place in breakdown.studied
        if place.component.kind or place.component.parameters
    ]
    assembled = breakdown.model.kind == "assembly"
    options = dict(breakdown.model.options)
    lines: list[Any] = []
    built, settings = [], {}
    for part in parts:
        level = levels[part.name]
        made = _made(part, level) if assembled else _Made(None, "part of the model", None)
        built.append(Built(part.name, level, made.told, _why(part, level)))
        if made.line is not None:
            lines.append(made.line)
        settings.update(_settings(breakdown, part, level, made.keeps))
    if assembled:
        _check_virtual(parts, [located(breakdown.folder, line) for line in lines])
        options["components"] = lines
    plan = ModelPlan(breakdown.model.kind, options, settings, tuple(built))
    _check(breakdown, parts, plan)
    return plan


class _Made(NamedTuple):
    line: dict[str, Any] | None
    told: str
    keeps: tuple[str, ...] | None
    """Parameters that are left; None: all."""


def _made(part: Component, level: Level) -> _Made:
    """The line of a component at its level."""
    if not part.kind:
        raise UsageError(
            f"component {part.name!r}: it has parameters, so it needs a kind: {', '.join(KINDS)}"
        )
    if part.kind not in KINDS:
        raise UsageError(
            f"component {part.name!r}: no kind {part.kind!r}; there are {', '.join(KINDS)}"
        )
    options = {key: value for key, value in part.options.items() if key != "estimate"}
    line: dict[str, Any] = {"name": part.name, "kind": part.kind}
    if part.axis is not None:
        line["axis"] = part.axis
    role = KINDS[part.kind].role
    if level != "black" or role == "box":
        return _Made({**line, **options}, part.kind, None)
    if role == "gearbox":
        bare = "ballscrew" if part.kind.endswith("ballscrew") else "gearbox"
        keeps = ("lead",) if bare == "ballscrew" else ("ratio",)
        told = f"{bare} that only transmits: no friction, no spring"
        return _Made({**line, "kind": bare, "friction": "none"}, told, keeps)
    if role in ("friction", "controller", "path"):
        told = "left out: what else rubs on its axis takes its friction"
        return _Made(None, told if role == "friction" else "left out: its output is given", ())
    return _Made({**line, **options}, f"{part.kind}, lumped: as described, not tuned", None)


def _why(part: Component, level: Level) -> str:
    if part.override is not None and part.override.level is not None:
        return f"overridden: {part.override.reason}"
    return {
        "white": "critical, and the data is there",
        "grey": f"completed by {part.physics}" if part.physics else "no detail is asked for",
        "black": "its inner working is unknown or of no interest",
    }[level]


def _settings(
    breakdown: Breakdown, part: Component, level: Level, keeps: tuple[str, ...] | None
) -> dict[str, dict[str, Json]]:
    """What the file says of a component's parameters, by the model's names."""
    said_laws = part.options.get("estimate", {})
    if not isinstance(said_laws, Mapping):
        raise UsageError(f"component {part.name!r}: expected estimate = {{ NAME = {{ law = … }} }}")
    found = {}
    for name in dict.fromkeys((*part.parameters, *said_laws)):
        if keeps is not None and name not in keeps:
            continue
        entry = _stated(part.parameters.get(name, ParameterPart()))
        if "value" not in entry and name in said_laws:
            entry |= _estimated(part, name, said_laws[name])
        entry.setdefault("source", "the model's own start value")
        if level == "black" and part.kind != "black_box":
            entry["editable"] = False
        found[breakdown.parameter_name(part, name)] = entry
    return found


def _stated(said: ParameterPart) -> dict[str, Json]:
    entry: dict[str, Json] = {
        key: getattr(said, key)
        for key in ("value", "low", "high", "sigma")
        if getattr(said, key) is not None
    }
    source = ": ".join(text for text in (said.source or "", said.cite) if text)
    return {**entry, "source": source} if source else entry


def _estimated(part: Component, name: str, said: Any) -> dict[str, Json]:
    if not isinstance(said, Mapping):
        raise UsageError(f"component {part.name!r}: {name}: expected a law, got {said!r}")
    with naming(f"component {part.name!r}: {name}"):
        found = estimate(said)
    return {"value": found.value, "source": found.source}


def _check_virtual(parts: list[Component], lines: list[dict[str, Any]]) -> None:
    """Virtual sensors that the file names must exist in what was made."""
    known = sensors_of(join(lines, machine))
    made = {str(line["name"]) for line in lines}
    for part in parts:
        for name in part.virtual:
            full = name if name in known else f"{part.name}.{name}"
            if part.name in made and full not in known:
                there = [one for one in known if one.startswith(f"{part.name}.")]
                raise UsageError(
                    f"component {part.name!r}: no virtual sensor {name!r}; "
                    f"there are {', '.join(there) or 'none inside it'}"
                )


def _check(breakdown: Breakdown, parts: list[Component], plan: ModelPlan) -> None:
    """The model can be built, and has every parameter that the file speaks of."""
    names = plan.model(breakdown.folder).parameters.names
    for part in parts:
        for name in part.parameters:
            full = breakdown.parameter_name(part, name)
            if full in plan.parameters and full not in names:
                own = [one for one in names if one.startswith(f"{part.name}.")]
                raise UsageError(
                    f"component {part.name!r}: no parameter {name!r} in the model; "
                    f"there are {', '.join(own or names)}"
                )


def _located(message: str, breakdown: Breakdown, file: str | Path | None) -> str:
    """The message with the line of the component that it names."""
    named = _NAMED.search(message)
    if file is None or named is None:
        return message
    written = Document(Path(file).read_text(encoding="utf-8-sig"), str(file))
    places = (path for path, place in breakdown.placed() if place.component.name == named[1])
    path = next(places, None)
    return message if path is None else f"{file}:{written.line(path)}: {message}"
