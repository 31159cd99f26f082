"""From expressions to a tape: the integers that `evertwin.models.modelica.kernel` runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from evertwin.models.modelica.graph import Graph
from evertwin.models.modelica.kernel import HEAD, OPS, WORDS
from evertwin.models.modelica.solve import Group

_CODE = {name: code for code, name in enumerate(OPS)}


class Layouts(NamedTuple):
    """Which leaf stands where, and what is wanted of them.

    >>> Layouts((), (), (), (), (), {}).slopes
    ()
    """

    parameters: tuple[int, ...]
    inputs: tuple[int, ...]
    states: tuple[int, ...]
    slopes: tuple[int, ...]
    """Nodes of the states' time derivatives."""
    outputs: tuple[int, ...]
    """Nodes of the outputs."""
    guesses: Mapping[int, int]
    """Unknown of a nonlinear group → node of its first guess."""
    groups: tuple[Group, ...] = ()
    adopts: tuple[tuple[int, int, int], ...] = ()
    """(output, state, sign) where an output is a state."""


class Stepping(NamedTuple):
    """How rows are cut.

    >>> Stepping().tolerance
    1e-08
    """

    step: float | None = None
    """Longest sub-step [s]; None: as long as the tolerance allows."""
    tolerance: float = 1e-8
    """Largest error of a sub-step, of 1 + |state|."""
    parts: int = 20_000
    """Most sub-steps of a row; a row that needs more is an error."""


class _Writer:
    """Writes operations; remembers which node lies in which register."""

    def __init__(self, graph: Graph, layouts: Layouts) -> None:
        self.graph, self.layouts = graph, layouts
        self.tape: list[int] = []
        self.lists: list[tuple[int, list[int]]] = []
        self.constants: list[float] = [0.0]
        wanted = [*layouts.slopes, *layouts.outputs, *layouts.guesses.values()]
        for group in layouts.groups:
            wanted += [*group.sides, *(s for row in group.slopes for s in row)]
        for node in graph.program(wanted):
            value = graph.value(node)
            if value is not None and value != 0.0:
                self.constants.append(value)
        self.place: dict[int, int] = {graph.constant(v): i for i, v in enumerate(self.constants)}
        for leaf in (*layouts.parameters, *layouts.inputs, *layouts.states):
            self.place[leaf] = len(self.place)
        self.registers = len(self.place)
        self.group_of = {leaf: group for group in layouts.groups for leaf in group.leaves}
        for group in layouts.groups:
            for leaf in group.leaves:
                self.place[leaf] = self._fresh()
        self.done: set[int] = set()
        """Groups that are solved already, by their first leaf."""

    def _fresh(self) -> int:
        self.registers += 1
        return self.registers - 1

    def operation(self, op: str, to: int, *args: int) -> None:
        """One operation."""
        self.tape += [_CODE[op], to, *args, *([0] * (WORDS - 2 - len(args)))]

    def compute(self, roots: Iterable[int]) -> None:
        """Everything that the roots need and that is not there yet."""
        for node in self.graph.program(roots):
            group = self.group_of.get(node)
            if group is not None:
                self._solve(group)
            elif node not in self.place:
                at = self.graph.nodes[node]
                # what a group gives may stand later in the graph than what needs it
                self.compute(a for a in at.args if a not in self.place)
                self.place[node] = self._fresh()
                self.operation(at.op, self.place[node], *(self.place[a] for a in at.args))

    def _solve(self, group: Group) -> None:
        if group.leaves[0] in self.done:
            return
        self.done.add(group.leaves[0])
        rows = [s for row in group.slopes for s in row]
        needed = [*group.sides, *rows]
        places = [self.place[leaf] for leaf in group.leaves]
        if group.linear:
            self.compute(needed)
            self._listed("linear", [*places, *(self.place[n] for n in needed)], group)
            return
        inside = set(group.leaves)
        # leaves of other groups have their places already, but may not be solved yet
        program = [
            n for n in self.graph.program(needed) if n not in self.place or n in self.group_of
        ]
        self.compute([n for n in program if self.graph.leaves(n).isdisjoint(inside)])
        entry = self._listed("newton", [], group)
        first = len(self.tape)
        for node in program:
            if node not in self.place:
                at = self.graph.nodes[node]
                self.place[node] = self._fresh()
                self.operation(at.op, self.place[node], *(self.place[a] for a in at.args))
        entry += [first, len(self.tape), *places, *(self.place[n] for n in needed)]

    def _listed(self, op: str, items: list[int], group: Group) -> list[int]:
        """An operation with a list; the list's place is filled in when all lists are there."""
        self.lists.append((len(self.tape) + 2, items))
        self.operation(op, 0, 0, len(group.leaves))
        return items

    def rowwise(self) -> list[int]:
        """Nodes that depend on no state and on no group."""
        moving = {*self.layouts.states, *self.group_of}
        groups = [n for g in self.layouts.groups for n in (*g.sides, *sum(g.slopes, ()))]
        wanted = [*self.layouts.slopes, *self.layouts.outputs, *groups]
        return [
            node for node in self.graph.program(wanted)
            if self.graph.leaves(node).isdisjoint(moving) and node not in self.place
        ]  # fmt: skip


def context(graph: Graph, layouts: Layouts, stepping: Stepping) -> tuple[int, ...]:
    """The integers of a model's context."""
    out = _Writer(graph, layouts)
    out.compute(out.rowwise())
    for leaf, guess in layouts.guesses.items():
        out.compute([guess])
        out.operation("copy", out.place[leaf], out.place[guess])
    stage = len(out.tape)
    out.compute(layouts.slopes)
    shown = len(out.tape)
    out.compute(layouts.outputs)
    return _joined(out, layouts, stepping, (stage, shown))


def _joined(
    out: _Writer, layouts: Layouts, stepping: Stepping, parts: tuple[int, int]
) -> tuple[int, ...]:
    base = len(HEAD)
    for at, items in out.lists:
        if out.tape[at - 2] == _CODE["newton"]:
            items[0], items[1] = items[0] + base, items[1] + base
    whole = [0] * base + out.tape
    said: dict[str, int] = {
        "constants": len(out.constants), "parameters": len(layouts.parameters),
        "inputs": len(layouts.inputs), "states": len(layouts.states),
        "outputs": len(layouts.outputs), "registers": out.registers, "row": base,
        "stage": base + parts[0], "out": base + parts[1], "fixed": int(stepping.step is not None),
        "size": _bits(stepping.step or 0.0), "tolerance": _bits(stepping.tolerance),
        "parts": stepping.parts, "adopted": len(layouts.adopts),
    }  # fmt: skip
    for key, items in (
        ("bits", [_bits(value) for value in out.constants]),
        ("slopes", [out.place[node] for node in layouts.slopes]),
        ("shown", [out.place[node] for node in layouts.outputs]),
        ("adopts", [number for entry in layouts.adopts for number in entry]),
    ):
        said[key] = len(whole)
        whole += items
    for at, items in out.lists:
        whole[base + at] = len(whole)
        whole += items
    said["end"] = len(whole)
    whole[:base] = [said[key] for key in HEAD]
    return tuple(whole)


def _bits(value: float) -> int:
    return int(np.array(value, dtype=np.float64).view(np.int64))
