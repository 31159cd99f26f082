"""Kinds of components: what each takes in and gives out, its options and its parameters.

A component is created on its own, from one line of a file, before anything is joined:

    { name = "gearbox1", kind = "stribeck_gearbox", axis = 1, ratio = 100, Fc = 6.0 }

Whatever is not an option of its kind is the start value of one of its parameters. What it passes on
at its ports decides what it can be joined with (`evertwin.machines.assembly.train`).

>>> motor = read_component({"name": "motor1", "kind": "motor", "axis": 1, "k": 0.1})
>>> motor.takes, motor.gives, motor.given["k"].value
('command', 'rotation', 0.1)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from evertwin.errors import UsageError, nearest
from evertwin.settings.quantity import Measured


class Kind(NamedTuple):
    """What a kind of component is.

    >>> KINDS["ballscrew"].gives
    'translation'
    """

    role: str
    """What it does on its axis; an axis has each role once, ``friction`` and ``box`` excepted."""
    takes: str
    """What comes in: command, rotation, any (of rotation and translation), or nothing."""
    gives: str
    """What goes out; ``same``: what comes in."""
    options: Mapping[str, Any] = {}
    """Keys that are no parameters, with their defaults."""
    about: str = ""


_RUB = {"friction": "tanh", "width": 0.02, "vs": 0.2, "standstill": 1e-3, "temperature": ""}
_SPRING = "spring and damper between the motor's side and the joint"
KINDS: Mapping[str, Kind] = {
    "path": Kind(
        "path", "", "command",
        {"moves": (), "start": (), "speed": (), "acceleration": (), "rate": 100.0,
         "profile": "trapezoid"},
        "input signal and path planning for all axes",
    ),
    "controller": Kind(
        "controller", "command", "command", {"feedback": "motor"},
        "position P, speed PI, with limits: a cascade",
    ),
    "motor": Kind(
        "motor", "command", "rotation", {"drive": ""},
        "torque constant, rotor inertia, winding resistance and inductance, back-EMF",
    ),
    "gearbox": Kind("gearbox", "rotation", "same", _RUB, "rigid, Coulomb and viscous friction"),
    "stribeck_gearbox": Kind(
        "gearbox", "rotation", "same", {**_RUB, "friction": "tanh+stribeck"},
        "rigid, with the Stribeck peak",
    ),
    "elastic_gearbox": Kind("gearbox", "rotation", "same", _RUB, _SPRING),
    "ballscrew": Kind("gearbox", "rotation", "translation", _RUB, "turns into travel by its lead"),
    "elastic_ballscrew": Kind("gearbox", "rotation", "translation", _RUB, _SPRING),
    "guide": Kind("friction", "any", "same", _RUB, "friction of the moving part itself"),
    "mass": Kind("structure", "translation", "", {}, "a mass on one axis"),
    "inertia": Kind("structure", "rotation", "", {}, "a moment of inertia on one axis"),
    "arm": Kind(
        "arm", "any", "",
        {"urdf": "", "dh": (), "convention": "", "before": {}, "tool": {}, "tip": "", "gravity": (),
         "base": False},
        "a serial arm: rigid bodies, joined by their joints",
    ),
    "payload": Kind("payload", "any", "", {}, "what the tip or the table carries"),
    "black_box": Kind(
        "box", "any", "same", {"model": {}, "inputs": {}, "output": "", "ratio": 0.0, "lead": 0.0},
        "another model, whose output is an effort against the motion",
    ),
}  # fmt: skip
"""Every kind of component by its name in a file."""


@dataclass(frozen=True)
class Given:
    """What a component's line says about one of its parameters.

    >>> Given(6.0, source="literature").low is None
    True
    """

    value: float
    low: float | None = None
    high: float | None = None
    editable: bool | None = None
    source: str | None = None


@dataclass(frozen=True)
class Component:
    """One component, created and not yet joined. Built by `read_component`.

    >>> Component("table", "mass", 1).role
    'structure'
    """

    name: str
    kind: str
    axis: int = 0
    """Axis that it belongs to, from 1; 0: all of them (path, arm, payload of an arm)."""
    options: Mapping[str, Any] = field(default_factory=dict)
    given: Mapping[str, Given] = field(default_factory=dict)
    """Start values of its parameters."""

    @property
    def role(self) -> str:
        """What it does on its axis."""
        return KINDS[self.kind].role

    @property
    def transmits(self) -> bool:
        """Does it stand between motor and joint? So does a black box with a ratio or a lead."""
        said = self.options.get("ratio", 0.0) or self.options.get("lead", 0.0)
        return self.role == "gearbox" or (self.role == "box" and bool(said))

    @property
    def drive(self) -> str:
        """What a motor is told: current, voltage or torque."""
        return str(self.option("drive") or "current")

    @property
    def takes(self) -> str:
        """What comes in at its port."""
        return KINDS[self.kind].takes

    @property
    def gives(self) -> str:
        """What goes out at its port."""
        turned = self.role == "box" and bool(self.options.get("lead", 0.0))
        return "translation" if turned else KINDS[self.kind].gives

    def option(self, key: str) -> Any:
        """What the line says, or the kind's default."""
        return self.options.get(key, KINDS[self.kind].options[key])


def read_component(line: Any) -> Component:
    """A component from one line of a file.

    Raises:
        UsageError: no table, no name, an unknown kind, a value that is no number.
    """
    if not isinstance(line, Mapping):
        raise UsageError(
            f"components: expected lines such as {{ name = …, kind = … }}, got {line!r}"
        )
    entries = dict(line)
    name, kind = str(entries.pop("name", "")), str(entries.pop("kind", ""))
    if not name:
        raise UsageError(f"components: expected a name in every line, got none in {dict(line)}")
    if kind not in KINDS:
        raise UsageError(f"component {name!r}: no kind {kind!r}, {nearest(kind, KINDS)}")
    axis = entries.pop("axis", 0)
    if not isinstance(axis, int) or isinstance(axis, bool) or axis < 0:
        raise UsageError(f"component {name!r}: expected axis = 1, 2, …, got {axis!r}")
    options = {key: entries.pop(key) for key in KINDS[kind].options if key in entries}
    given = {key: _given(name, key, value) for key, value in entries.items()}
    part = Component(name, kind, axis, options, given)
    if part.role == "motor" and part.drive not in ("current", "voltage", "torque"):
        raise UsageError(
            f"component {name!r}: expected drive = 'current', 'voltage' or 'torque', "
            f"got {part.drive!r}"
        )
    return part


def _given(name: str, key: str, value: Any) -> Given:
    """A number, or a table with ``value`` and what else is known."""
    try:
        if isinstance(value, Mapping):
            return Given(**value)
        if isinstance(value, bool):
            raise TypeError(value)
        return Given(value if isinstance(value, Measured) else float(value))
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"component {name!r}: {key} is no option of its kind, and as a parameter it needs a "
            f"number or a table with value, low, high, editable, source; got {value!r}"
        ) from error
