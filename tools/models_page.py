"""The reference page of model kinds: equations from the docstrings, channels, options and
parameters from the models themselves."""

from __future__ import annotations

import ast
import importlib
import inspect
import itertools
import json
import pkgutil
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import evertwin.machines.friction.terms as terms
from evertwin.machines.catalog import MACHINES, machine
from evertwin.machines.friction import FrictionTerm
from evertwin.models import Model, Parameter
from evertwin.signals import Layout

__all__ = ["page"]

_OPENING = """# Model kinds

`[model] kind` of a twin file, with its `options`. A channel of `[source.channels]` may be in any
unit that measures the same; inside, and in `[model.parameters]` without a unit, everything is SI
but for [a function of your own](../how-to/model-of-your-own.md), in the units that it states.
*Tuned* is the model's proposal: `[tuning] editable` and `[model.parameters.NAME] editable` decide.
"""
_SHOWN: Mapping[str, tuple[Mapping[str, Any], ...]] = {
    "thermal": ({}, {"wall": True}), "drive_force": ({}, {"law": "sign+stribeck+spring"}),
    "drive": ({},), "differential": ({}, {"wheels": True}), "bicycle": ({},), "odometer": ({},),
    "omni": ({},), "robot1d": ({},),
}  # fmt: skip
"""Kinds whose channels are known without a file, with the options that are shown."""
_OPENS = frozenset({"thermal", "drive"})
"""Kinds of which the module's text has the equations."""
_MORE = {
    "arm": ("machines.arm.dh", "machines.arm.coupling", "machines.arm.shafts"),
    "fmu": ("models.fmu.binding",),
    "mujoco": ("models.mujoco.channels", "models.mujoco.knobs"),
}
"""Kinds whose options, channels or parameters are told by other modules."""
_OPTIONS = {"fmu": "evertwin.models.fmu.options"}
"""Kinds whose options are the fields of a class `Options`."""


def _prose(text: str | None) -> str:
    """A docstring without examples; indented lines as formulas."""
    kept: list[str] = []
    for part in inspect.cleandoc(text or "").split("\n\n"):
        if part.lstrip().startswith(">>>"):
            continue
        formula = part.startswith("    ")
        shown = textwrap.dedent(part) if formula else part.replace("``", "`")
        kept.append(f"```text\n{shown}\n```" if formula else shown)
    return "\n\n".join(kept)


def _channels(layout: Layout) -> str:
    return ", ".join(
        f"`{one.name}` [{one.unit}]" + (" (an angle)" if one.kind == "angle" else "")
        for one in layout
    )


def _row(item: Parameter) -> str:
    value = f"{item.value:g} | {item.low:g} … {item.high:g}"
    return f"| `{item.name}` | {item.unit} | {value} | {'yes' if item.editable else 'no'} |"


def _built(options: Mapping[str, Any], model: Model) -> Iterator[str]:
    said = ", ".join(f"{key} = {json.dumps(value)}" for key, value in options.items())
    yield f"With `{said}`:" if options else "Without options:"
    yield (
        f"inputs {_channels(model.inputs)}; outputs {_channels(model.outputs)}; states "
        f"{_channels(model.states) if len(model.states) else 'none (a static map)'}."
    )
    table = "| parameter | unit | start | bounds | tuned |\n|---|---|---|---|---|\n"
    yield table + "\n".join(_row(item) for item in model.parameters)


def _fields(module: str) -> str:
    """A table of the fields of `Options`, with their defaults and the text below each."""
    options = importlib.import_module(module).Options
    tree: Any = ast.parse(textwrap.dedent(inspect.getsource(options)))
    rows = ["| option | default | meaning |", "|---|---|---|"]
    for field, said in itertools.pairwise(tree.body[0].body):
        if isinstance(field, ast.AnnAssign) and field.value is not None:
            default = ast.unparse(field.value)
            default = "absent" if default.startswith(("field", "None", "''")) else f"`{default}`"
            text = " ".join(inspect.cleandoc(ast.literal_eval(said.value)).split())
            rows.append(f"| `{ast.unparse(field.target)}` | {default} | {text} |")
    return "\n".join(rows).replace("``", "`")


def _kind(name: str) -> Iterator[str]:
    place = MACHINES[name][0].partition(":")
    module = importlib.import_module(place[0])
    factory: Any = module
    for part in place[2].split("."):
        factory = getattr(factory, part)
    yield f"## `{name}`"
    if name in _OPENS:
        yield _prose(module.__doc__)
    if name == "python":
        yield "See [a model of your own](../how-to/model-of-your-own.md)."
    yield _prose(factory.__doc__)
    options = [
        f"`{key}`" if one.default is one.empty else f"`{key} = {one.default!r}`"
        for key, one in inspect.signature(factory).parameters.items()
        if one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL)
    ]
    if options:
        yield f"Options: {', '.join(options)}."
    for more in _MORE.get(name, ()):
        yield _prose(importlib.import_module(f"evertwin.{more}").__doc__)
    if name in _OPTIONS:
        yield _fields(_OPTIONS[name])
    for chosen in _SHOWN.get(name, ()):
        yield from _built(chosen, machine(name, chosen))


def _terms() -> Iterator[tuple[FrictionTerm, str]]:
    """Each term, and how its file opens."""
    for one in pkgutil.iter_modules(terms.__path__):
        module = importlib.import_module(f"{terms.__name__}.{one.name}")
        opening = _prose(module.__doc__).partition("\n")[0].replace("|", "\\|")
        yield from (
            (item, opening) for item in vars(module).values() if isinstance(item, FrictionTerm)
        )


def _friction() -> Iterator[str]:
    yield "## Terms of a friction law"
    yield _prose(importlib.import_module("evertwin.machines.friction").__doc__)
    rows = (
        f"| `{term.name}` | {', '.join(f'`{c.name}`' for c in term.coefficients)} | "
        f"{', '.join(f'`{s.name}`' for s in term.shape) or '-'} | "
        f"{', '.join(term.confused_with) or '-'} | {opening} |"
        for term, opening in _terms()
    )
    heading = "| term | coefficients | shapes | may be confused with | what it is |"
    yield "\n".join([heading, "|---|---|---|---|---|", *rows])


def page() -> str:
    """Markdown: each kind, then the terms of a friction law."""
    parts = [_OPENING.strip()]
    for name in sorted(MACHINES, key=lambda one: (one not in _SHOWN, list(MACHINES).index(one))):
        parts += _kind(name)
    return "\n\n".join([*parts, *_friction()]) + "\n"
