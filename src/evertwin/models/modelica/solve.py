"""From equations to slopes: every unknown as an expression of states, inputs and parameters.

Equations are ordered; inside a group what has a plain factor is put into the others first, so that
most loops of a mechanical model vanish. What remains is solved while stepping: linear groups by
elimination, others by Newton's rule with exact slopes.

Which equation gives which unknown, and in which order.

A matching gives each equation one unknown; the strongly connected parts of what each needs are the
smallest systems that must be solved together, and they can be solved one after the other.

>>> matched([{0, 1}, {1}], 2)
([0, 1], [])
>>> ordered([{0, 1}, {1}], [0, 1])
[[1], [0]]
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.errors import ModelError
from evertwin.models.modelica.flat import Equation
from evertwin.models.modelica.graph import Graph
from evertwin.models.modelica.reduce import Reduced, merge_once


def _graph(pairs: Iterable[tuple[int, int]], rows: int, columns: int) -> Any:
    places = np.array(sorted(pairs), dtype=np.int32).reshape(-1, 2)
    ones = np.ones(len(places), dtype=np.int8)
    return scipy.sparse.csr_array((ones, (places[:, 0], places[:, 1])), shape=(rows, columns))


def matched(uses: Sequence[set[int]], unknowns: int) -> tuple[list[int], list[int]]:
    """(unknown of each equation, −1: none; equations that share too few unknowns).

    Args:
        uses: unknowns that occur in each equation, by number.
        unknowns: how many there are.
    """
    if not uses or not unknowns:
        return [-1] * len(uses), list(range(len(uses)))[:1]
    graph = _graph(((e, u) for e, used in enumerate(uses) for u in used), len(uses), unknowns)
    gives = scipy.sparse.csgraph.maximum_bipartite_matching(graph, "column").tolist()
    owner = {unknown: equation for equation, unknown in enumerate(gives) if unknown >= 0}
    bound: set[int] = set()
    more = {gives.index(-1)} if -1 in gives else set()
    while not more <= bound:  # all that an equation without an unknown would have to take one from
        bound |= more
        more = {owner[unknown] for equation in bound for unknown in uses[equation]}
    return gives, sorted(bound)


def ordered(uses: Sequence[set[int]], gives: Sequence[int]) -> list[list[int]]:
    """Equations in groups that must be solved together, each after those it needs.

    Args:
        uses: unknowns that occur in each equation.
        gives: the unknown that each equation gives.
    """
    owner = {unknown: equation for equation, unknown in enumerate(gives)}
    needs = {(e, owner[u]) for e, used in enumerate(uses) for u in used}
    graph = _graph(needs, len(uses), len(uses))
    _, group = scipy.sparse.csgraph.connected_components(graph, connection="strong")
    before: dict[int, set[int]] = {int(one): set() for one in group}
    for equation, other in needs:
        if group[equation] != group[other]:
            before[int(group[equation])].add(int(group[other]))
    turns = TopologicalSorter(before).static_order()
    return [np.flatnonzero(group == one).tolist() for one in turns]


class Group(NamedTuple):
    """Unknowns that are solved together while stepping.

    >>> Group((0,), (1,), ((2,),), True).linear
    True
    """

    leaves: tuple[int, ...]
    sides: tuple[int, ...]
    """Linear: right sides. Otherwise: what has to be zero."""
    slopes: tuple[tuple[int, ...], ...]
    """Row by row."""
    linear: bool

    @property
    def nodes(self) -> list[int]:
        """Sides, then slopes."""
        return [*self.sides, *sum(self.slopes, ())]


@dataclass
class Solved:
    """What stepping needs.

    >>> Solved(Graph()).groups
    []
    """

    graph: Graph
    known: dict[int, int] = field(default_factory=dict)
    """Unknown leaf → its expression."""
    groups: list[Group] = field(default_factory=list)
    """In the order in which they are solved."""
    states: list[tuple[str, int]] = field(default_factory=list)
    """Variable and order of each state."""

    def node(self, node: int) -> int:
        """An expression in states, inputs, parameters and the unknowns of groups."""
        return self.graph.mapped(node, self.known)


def solved(out: Reduced) -> Solved:
    """Orders and solves the equations.

    Raises:
        ModelError: there are too few equations for some unknowns, with their lines.
    """
    while True:
        orders = out.orders()
        unknowns = {
            out.graph.leaf(name, order): k for k, (name, order) in enumerate(orders.items())
        }
        uses = [
            {unknowns[leaf] for leaf in out.graph.leaves(e.node) if leaf in unknowns}
            for e in out.equations
        ]
        gives, bound = matched(uses, len(unknowns))
        if not bound and len(uses) == len(unknowns):
            break
        if not bound or not merge_once(out, bound, simple=False):
            raise _singular(out, bound)
    found = Solved(out.graph)
    found.states = [(name, k) for name, order in orders.items() for k in range(order)]
    leaves = list(unknowns)
    for group in ordered(uses, gives):
        _group(found, [out.equations[e] for e in group], [leaves[gives[e]] for e in group])
    return found


def _singular(out: Reduced, bound: Iterable[int]) -> ModelError:
    places = list(dict.fromkeys(out.equations[e].place for e in bound))
    where = places[0] if places else "model"
    more = f" (with {', '.join(places[1:4])})" if len(places) > 1 else ""
    return ModelError(
        f"{where}: these equations bind states to each other, and not by a relation that one of "
        f"them can be taken out by{more}: choose other states, or take OpenModelica (via)"
    )


def _group(found: Solved, equations: list[Equation], leaves: list[int]) -> None:
    """Solves one group; what it gives goes into ``found.known``."""
    graph = found.graph
    sides = [found.node(e.node) for e in equations]
    later: list[tuple[int, int]] = []
    while len(sides) > 1:
        pick = _plain(graph, sides, leaves)
        if pick is None:
            break
        at, leaf, value = pick
        sides.pop(at)
        leaves = [other for other in leaves if other != leaf]
        sides = [graph.mapped(side, {leaf: value}) for side in sides]
        later.append((leaf, value))
    _core(found, sides, leaves, equations[0].place)
    for leaf, value in reversed(later):
        found.known[leaf] = found.node(value)


def _plain(graph: Graph, sides: list[int], leaves: list[int]) -> tuple[int, int, int] | None:
    """An equation that gives one of the leaves with a number as its factor."""
    for at, side in enumerate(sides):
        for leaf in leaves:
            split = graph.affine(side, leaf)
            factor = None if split is None else graph.value(split[0])
            if split is not None and factor:
                return at, leaf, graph("multiply", graph.constant(-1.0 / factor), split[1])
    return None


def _core(found: Solved, sides: list[int], leaves: list[int], place: str) -> None:
    graph = found.graph
    if len(sides) == 1:
        split = graph.affine(sides[0], leaves[0])
        if split is not None:
            if graph.value(split[0]) == 0.0:
                raise ModelError(
                    f"{place}: {graph.shown(leaves[0])} drops out of its equation: add one"
                )
            found.known[leaves[0]] = graph("negate", graph("divide", split[1], split[0]))
            return
    slopes = tuple(tuple(graph.slope(side, leaf) for leaf in leaves) for side in sides)
    among = set(leaves)
    linear = all(graph.leaves(s).isdisjoint(among) for row in slopes for s in row)
    if linear:
        zero = {leaf: graph.constant(0.0) for leaf in leaves}
        sides = [graph("negate", graph.mapped(side, zero)) for side in sides]
    found.groups.append(Group(tuple(leaves), tuple(sides), slopes, linear))
