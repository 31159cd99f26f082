"""A Modelica model as a Model: its parameters, inputs and outputs, stepped row by row.

Parameters with a plain number are the model's parameters, with unit, bounds and description as
declared; what follows from others, is final, or is an Integer, is not. Declared outputs are the
outputs; one that is a state is adopted from its measurement. Names lose their brackets
(``joint[2].q`` becomes ``joint2.q``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from evertwin.errors import ModelError, UsageError, naming
from evertwin.models.compiled import Compiled
from evertwin.models.modelica.compiler import Limits, equations
from evertwin.models.modelica.flat import Flat, Variable
from evertwin.models.modelica.kernel import observe, step
from evertwin.models.modelica.reader import read_flat
from evertwin.models.modelica.reduce import Reduced, reduced
from evertwin.models.modelica.solve import Solved, solved
from evertwin.models.modelica.tape import Layouts, Stepping, context
from evertwin.models.parameters import Parameter, Parameters
from evertwin.signals.channels import Channel, Layout
from evertwin.signals.units import conversion, si_unit
from evertwin.types import ParameterVector, StateVector

Built = TypeVar("Built")
LIBRARY = Path(__file__).parent / "library" / "Evertwin.mo"
"""Parts of machines in Modelica, and machines made of them."""


class Modelica(Compiled):
    """The model ``model`` of a Modelica file.

    Args:
        model: its name, with dots inside packages; by default the only one of the file.
        file: the ``.mo`` file; by default the library that comes along, `LIBRARY`, which every
            file may use too.
        libraries: folders and files with further libraries that it uses.
        step: longest sub-step [s]; by default as long as ``tolerance`` allows.
        tolerance: largest error of a sub-step, of 1 + \\|state\\|.
        limit: longest time that the compiler may take [s].

    Raises:
        UsageError: no such file, or it declares no output.
        MissingExtra: rumoca is not installed.
        ModelError: the model is refused, with file and line.

    >>> axis = Modelica("Evertwin.Axis")
    >>> axis.inputs.names, axis.outputs.names
    (('torque',), ('q', 'v'))
    """

    def __init__(
        self, model: str | None = None, file: str = "", libraries: Sequence[str] = (),
        step: float | None = None, tolerance: float = 1e-8, limit: float = 60.0,
    ) -> None:  # fmt: skip
        if (step is not None and not step > 0) or not tolerance > 0 or not limit > 0:
            raise UsageError(
                f"modelica: expected step, tolerance and limit above 0, got {step}, {tolerance} "
                f"and {limit}"
            )
        roots = (*libraries, str(LIBRARY)) if file else libraries
        found = equations(Path(file) if file else LIBRARY, model, roots, Limits(limit))
        self._build(read_flat(found), Stepping(step, tolerance))

    def _build(self, flat: Flat, stepping: Stepping) -> None:
        out = reduced(flat)
        done = solved(out)
        names = _state_names(flat, out, done)
        shown = [v for v in flat.unknowns if v.output]
        if not shown:
            raise UsageError(f"{flat.name}: expected at least one output, it declares none")
        states = tuple(out.graph.leaf(name, order) for name, order in done.states)
        nodes = tuple(done.node(out.node(v.name)) for v in shown)
        slopes = tuple(done.node(out.graph.leaf(n, k + 1)) for n, k in done.states)
        layouts = Layouts(
            tuple(p.leaf for p in flat.parameters), tuple(v.leaf for v in flat.inputs), states,
            slopes, nodes, _guesses(flat, out, done), tuple(done.groups),
            _adopts(out, nodes, states),
        )  # fmt: skip
        _complete(out, layouts, done)
        starts = _starts(flat, out, done)
        super().__init__(
            Layout(tuple(_channel(v) for v in flat.inputs)),
            Layout(tuple(_channel(v) for v in shown)),
            Layout(tuple(Channel(name, unit) for name, unit in names)),
            _parameters(flat), step.address, observe.address,
            context(out.graph, layouts, stepping),
        )  # fmt: skip
        object.__setattr__(self, "notes", _notes(flat))
        object.__setattr__(self, "_graph", out.graph)
        object.__setattr__(self, "_starts", starts)
        object.__setattr__(self, "_leaves", layouts.parameters)
        object.__setattr__(self, "initials", _initials(out, layouts, starts))

    notes: tuple[str, ...]
    """Where the equations switch: sub-steps do not stop there."""
    initials: tuple[str, ...]
    """Parameters that are only the start of a state: free for each recording."""
    _graph: Any
    _starts: tuple[int, ...]
    _leaves: tuple[int, ...]

    def initial(self, p: ParameterVector) -> StateVector:
        """Start values of the states under the parameters."""
        values = dict(zip(self._leaves, p.tolist(), strict=True))
        return np.array(self._graph.evaluate(list(self._starts), values), dtype=np.float64)


def _channel(variable: Variable) -> Channel:
    low, high = variable.low, variable.high
    build = partial(Channel, variable.name, variable.unit, low=low, high=high)
    return _placed(variable.place, variable.unit, build)


def _placed(place: str, unit: str, build: Callable[[], Built]) -> Built:
    """What is built, if its unit is one that values are computed in."""
    with naming(place, UsageError, ModelError):
        found = build()
        plain = conversion(unit) == (1.0, 0.0)
    if not plain:
        raise ModelError(
            f"{place}: expected an SI unit, since values are computed as they stand, got {unit!r}: "
            f"declare it in {si_unit(unit)!r}"
        )
    return found


def _parameters(flat: Flat) -> Parameters:
    items = []
    for g in flat.parameters:
        value = flat.graph.value(g.start or 0) or 0.0
        parts = (g.name, value, g.unit, g.low, g.high)
        build = partial(Parameter, *parts, source=g.text or "as declared")
        items.append(_placed(g.place, g.unit, build))
    return Parameters(tuple(items))


def _state_names(flat: Flat, out: Reduced, done: Solved) -> list[tuple[str, str]]:
    """Name and unit of each state: of the variable that it is, outputs first."""
    known = sorted(flat.unknowns, key=lambda v: not v.output)
    names = []
    for name, order in done.states:
        leaf = out.graph.leaf(name, order)
        same = [v for v in known if out.node(v.name) == leaf]
        names.append((same[0].name, same[0].unit) if same else (f"der{order}.{name}", "1"))
    return names


def _signed(out: Reduced, node: int) -> tuple[int, int]:
    """(leaf, sign) of a node that is a leaf up to its sign; else the node itself."""
    at = out.graph.nodes[node]
    return (at.args[0], -1) if at.op == "negate" else (node, 1)


def _adopts(
    out: Reduced, nodes: Sequence[int], states: Sequence[int]
) -> tuple[tuple[int, int, int], ...]:
    found = []
    for k, node in enumerate(nodes):
        leaf, sign = _signed(out, node)
        if leaf in states:
            found.append((k, states.index(leaf), sign))
    return tuple(found)


def _guesses(flat: Flat, out: Reduced, done: Solved) -> dict[int, int]:
    """First guesses of nonlinear groups: the start values of their unknowns."""
    start = {v.leaf: v.start for v in flat.unknowns}
    unknowns = [leaf for group in done.groups if not group.linear for leaf in group.leaves]
    zero = out.graph.constant(0.0)
    return {leaf: zero if start.get(leaf) is None else int(start[leaf] or 0) for leaf in unknowns}


def _complete(out: Reduced, layouts: Layouts, done: Solved) -> None:
    """Does everything follow from states, inputs and parameters?"""
    known = {*layouts.parameters, *layouts.inputs, *layouts.states}
    known |= {leaf for group in done.groups for leaf in group.leaves}
    for node in (*layouts.slopes, *layouts.outputs):
        for leaf in out.graph.leaves(node):
            if leaf not in known:
                raise ModelError(f"{out.flat.name}: nothing gives {out.graph.shown(leaf)}")


def _starts(flat: Flat, out: Reduced, done: Solved) -> tuple[int, ...]:
    """Node of each state's start value: of an initial equation, else as declared, else 0."""
    graph = out.graph
    states = {graph.leaf(name, order): graph.constant(0.0) for name, order in done.states}
    zero = graph.constant(0.0)
    for variable in sorted(flat.unknowns, key=lambda v: v.output):
        if variable.start is not None and variable.start != zero:
            _started(out, states, graph("subtract", variable.leaf, variable.start))
    for equation in flat.initial:
        if not _started(out, states, equation.node):
            raise ModelError(
                f"{equation.place}: an initial equation has to give one state from parameters: "
                "write start values instead"
            )
    return tuple(states.values())


def _started(out: Reduced, states: dict[int, int], node: int) -> bool:
    """Notes the start that ``node = 0`` gives to one state; False if it gives none."""
    graph = out.graph
    replaced = {graph.leaf(name): by for name, by in out.replaced.items()}
    node = graph.mapped(node, replaced)
    found = [leaf for leaf in graph.leaves(node) if graph.nodes[leaf].name in out.moving]
    split = graph.affine(node, found[0]) if len(found) == 1 and found[0] in states else None
    if split is None:
        return False
    states[found[0]] = graph("negate", graph("divide", split[1], split[0]))
    return True


def _initials(out: Reduced, layouts: Layouts, starts: Sequence[int]) -> tuple[str, ...]:
    graph = out.graph
    used = frozenset().union(*(graph.leaves(n) for n in layouts.wanted))
    begins = frozenset().union(*(graph.leaves(n) for n in starts))
    return tuple(graph.nodes[p].name for p in layouts.parameters if p in begins and p not in used)


def _notes(flat: Flat) -> tuple[str, ...]:
    return tuple(f"{place}: switches; sub-steps do not stop there" for place in flat.notes)
