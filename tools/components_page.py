"""The reference page of component kinds, from the same tables that read them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from evertwin.machines.assembly.parts import KINDS, Component
from evertwin.machines.assembly.quantities import parameters_of
from evertwin.machines.assembly.sensors import sensors_of
from evertwin.machines.assembly.train import join
from evertwin.models import Parameter

__all__ = ["page"]

_OPENING = """# Component kinds

A component is one line under `[model.options] components` of a twin file with `kind = "assembly"`:
`name`, `kind`, `axis` (from 1), options of its kind, and start values of its parameters, each as a
number or as a table with `value`, `low`, `high`, `editable`, `source`. Parameters are called
`<component>.<parameter>`, here `gearbox1.Fc`. What turns counts in rad and Nm, what slides in m
and N.

## Kinds

| kind | takes | gives | what it is |
|---|---|---|---|
"""
_PARAMETERS = """## Parameters

A Stribeck law and a heat balance are switched on in this example; `tuned` is the proposal, the twin
file decides.

| parameter | unit | start | bounds | tuned |
|---|---|---|---|---|
"""
_EXAMPLES: tuple[tuple[str, str, Mapping[str, Any], bool], ...] = (
    ("gearbox1", "elastic_gearbox", {"friction": "tanh+stribeck", "temperature": "state"}, False),
    ("screw1", "elastic_ballscrew", {"friction": "none"}, True),
    ("motor1", "motor", {}, False),
    ("controller1", "controller", {}, False),
    ("table1", "mass", {}, True),
    ("body1", "inertia", {}, False),
)


def _kinds() -> Iterator[str]:
    for name, kind in KINDS.items():
        ports = (kind.takes or "nothing", "the same" if kind.gives == "same" else kind.gives)
        yield f"| `{name}` | {ports[0]} | {ports[1] or 'nothing'} | {kind.about} |"


def _options() -> Iterator[str]:
    for name, kind in KINDS.items():
        said = ", ".join(f"`{key}` = {value!r}" for key, value in kind.options.items())
        if said:
            yield f"| `{name}` | {said} |"


def _row(item: Parameter) -> str:
    tuned = "yes" if item.editable else "no"
    value = f"{item.value:g}"
    return f"| `{item.name}` | {item.unit} | {value} | {item.low:g} … {item.high:g} | {tuned} |"


def _parameters() -> Iterator[str]:
    for name, kind, options, slides in _EXAMPLES:
        part = Component(name, kind, 1, options)
        yield from (_row(item) for item in parameters_of(part, slides))


def _sensors() -> Iterator[str]:
    lines = [
        {"name": "controller1", "kind": "controller", "axis": 1},
        {"name": "motor1", "kind": "motor", "axis": 1},
        {"name": "gearbox1", "kind": "elastic_gearbox", "axis": 1, "temperature": "state"},
        {"name": "body1", "kind": "inertia", "axis": 1},
    ]
    for name, sensor in sensors_of(join(lines)).items():
        yield f"| `{name}` | {sensor.unit} | {'forward' if sensor.forward else 'both'} |"


def page() -> str:
    """Markdown: kinds, options, parameters, virtual sensors."""
    parts = [
        _OPENING + "\n".join(_kinds()),
        "## Options, with their defaults\n\n| kind | options |\n|---|---|\n"
        + "\n".join(_options()),
        _PARAMETERS + "\n".join(_parameters()),
        "## Virtual sensors\n\n| name | unit | reading |\n|---|---|---|\n" + "\n".join(_sensors()),
    ]
    return "\n\n".join(parts) + "\n"
