"""From expressions to a tape: the integers that `evertwin.models.modelica.kernel` runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from evertwin.models.modelica import kernel as at
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

    @property
    def wanted(self) -> list[int]:
        """All nodes that stepping needs but guesses."""
        return [*self.slopes, *self.outputs, *(n for group in self.groups for n in group.nodes)]


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
        for node in graph.program([*layouts.wanted, *layouts.guesses.values()]):
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
                # what a group gives may stand later in the graph than what needs it
                self.compute(a for a in self.graph.nodes[node].args if a not in self.place)
                self._node(node)

    def _node(self, node: int) -> None:
        """The operation of one node, whose arguments are there."""
        found = self.graph.nodes[node]
        self.place[node] = self._fresh()
        self.operation(found.op, self.place[node], *(self.place[a] for a in found.args))

    def _solve(self, group: Group) -> None:
        if group.leaves[0] in self.done:
            return
        self.done.add(group.leaves[0])
        needed = group.nodes
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
        first = HEAD + len(self.tape)
        for node in program:
            if node not in self.place:
                self._node(node)
        entry += [first, HEAD + len(self.tape), *places, *(self.place[n] for n in needed)]

    def _listed(self, op: str, items: list[int], group: Group) -> list[int]:
        """An operation with a list; the list's place is filled in when all lists are there."""
        self.lists.append((len(self.tape) + 2, items))
        self.operation(op, 0, 0, len(group.leaves))
        return items

    def rowwise(self) -> list[int]:
        """Nodes that depend on no state and on no group."""
        moving = {*self.layouts.states, *self.group_of}
        return [
            node for node in self.graph.program(self.layouts.wanted)
            if self.graph.leaves(node).isdisjoint(moving) and node not in self.place
        ]  # fmt: skip


def context(graph: Graph, layouts: Layouts, stepping: Stepping) -> tuple[int, ...]:
    """The integers of a model's context."""
    out = _Writer(graph, layouts)
    whole = [0] * HEAD
    whole[at.ROW] = HEAD
    out.compute(out.rowwise())
    for leaf, guess in layouts.guesses.items():
        out.compute([guess])
        out.operation("copy", out.place[leaf], out.place[guess])
    whole[at.STAGE] = HEAD + len(out.tape)
    out.compute(layouts.slopes)
    whole[at.OUT] = HEAD + len(out.tape)
    out.compute(layouts.outputs)
    counts = (out.constants, layouts.parameters, layouts.inputs, layouts.states, layouts.outputs)
    whole[: len(counts)] = map(len, counts)
    whole[at.REGISTERS], whole[at.ADOPTED] = out.registers, len(layouts.adopts)
    whole[at.FIXED], whole[at.PARTS] = int(stepping.step is not None), stepping.parts
    whole[at.SIZE : at.PARTS] = _bits([stepping.step or 0.0, stepping.tolerance])
    whole += out.tape
    for place, items in (
        (at.BITS, _bits(out.constants)),
        (at.SLOPES, [out.place[node] for node in layouts.slopes]),
        (at.SHOWN, [out.place[node] for node in layouts.outputs]),
        (at.ADOPTS, [number for entry in layouts.adopts for number in entry]),
        *((HEAD + place, items) for place, items in out.lists),
    ):
        whole[place] = len(whole)
        whole += items
    whole[at.END] = len(whole)
    return tuple(whole)


def _bits(values: list[float]) -> list[int]:
    return np.array(values, dtype=np.float64).view(np.int64).tolist()  # type: ignore[no-any-return]
