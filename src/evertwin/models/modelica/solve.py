"""From equations to slopes: every unknown as an expression of states, inputs and parameters.

Equations are ordered; inside a group what has a plain factor is put into the others first, so that
most loops of a mechanical model vanish. What remains is solved while stepping: linear groups by
elimination, others by Newton's rule with exact slopes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from evertwin.errors import ModelError
from evertwin.models.modelica.flat import Equation
from evertwin.models.modelica.graph import Graph
from evertwin.models.modelica.order import matched, ordered
from evertwin.models.modelica.reduce import Reduced, freed


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
        if not bound or not freed(out, bound):
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
