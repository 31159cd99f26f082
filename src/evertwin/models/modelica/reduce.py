"""Fewer variables: what another variable stands for is replaced, everywhere and for all times.

Where an equation says ``v = f(others)``, v goes, and its derivatives become those of f. Equal
angles at a flange become one; ``φ_motor = ratio·φ_load`` takes the motor's angle and speed out of
the states, which is what rigidly coupled inertias need (their equations bind states to each
other, so they cannot all be integrated). Declared outputs are kept longest, so that they become
the states.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from evertwin.errors import ModelError
from evertwin.models.modelica.flat import Equation, Flat, Variable
from evertwin.models.modelica.graph import Graph, Node


def rate(graph: Graph, node: int, moving: frozenset[str]) -> int:
    """d(node)/dt, with a leaf of the next order for each moving leaf."""
    parts = []
    for leaf in sorted(graph.leaves(node)):
        at = graph.nodes[leaf]
        if at.name in moving:
            parts.append(
                graph("multiply", graph.slope(node, leaf), graph.leaf(at.name, at.order + 1))
            )
    return graph.sum(parts)


@dataclass
class Reduced:
    """Equations that are left, and what was replaced by what.

    >>> Reduced.__name__
    'Reduced'
    """

    flat: Flat
    graph: Graph
    equations: list[Equation]
    replaced: dict[str, int] = field(default_factory=dict)
    """Variable → its expression in the variables that are left."""
    moving: frozenset[str] = frozenset()

    def left(self) -> list[Variable]:
        """Variables that are still there."""
        return [v for v in self.flat.unknowns if v.name not in self.replaced]

    def orders(self) -> dict[str, int]:
        """The highest derivative of each variable that is left."""
        out = {v.name: 0 for v in self.left()}
        for equation in self.equations:
            for leaf in self.graph.leaves(equation.node):
                at = self.graph.nodes[leaf]
                if at.name in out:
                    out[at.name] = max(out[at.name], at.order)
        return out

    def node(self, name: str) -> int:
        """A variable, in the variables that are left."""
        return self.replaced.get(name, self.graph.leaf(name))

    def replace(self, number: int, name: str, node: int) -> None:
        """Takes ``name = node`` (equation ``number``) out of all equations.

        Raises:
            ModelError: the derivative of an input is needed.
        """
        place = self.equations.pop(number).place
        new = self._derivatives(name, node, place)
        self.equations = [e._replace(node=self.graph.mapped(e.node, new)) for e in self.equations]
        self.replaced = {n: self.graph.mapped(e, new) for n, e in self.replaced.items()}
        self.replaced[name] = node

    def _derivatives(self, name: str, node: int, place: str) -> dict[int, int]:
        highest = self.orders()[name]
        for expression in self.replaced.values():
            for leaf in self.graph.leaves(expression):
                at = self.graph.nodes[leaf]
                highest = max(highest, at.order) if at.name == name else highest
        new = {self.graph.leaf(name): node}
        inputs = {v.name for v in self.flat.inputs}
        for order in range(1, highest + 1):
            node = rate(self.graph, node, self.moving)
            new[self.graph.leaf(name, order)] = node
            for leaf in self.graph.leaves(node):
                at = self.graph.nodes[leaf]
                if at.name in inputs and at.order:
                    raise ModelError(
                        f"{place}: the derivative of the input {at.name} is needed: inputs are "
                        f"held over a row, so give der({at.name}) as an input of its own"
                    )
        return new


def reduced(flat: Flat) -> Reduced:
    """The flat model with equalities of two variables taken out."""
    moving = frozenset(v.name for v in (*flat.unknowns, *flat.inputs))
    out = Reduced(flat, flat.graph, list(flat.equations), {}, moving)
    while merge_once(out, range(len(out.equations)), simple=True):
        pass
    return out


def merge_once(out: Reduced, among: Iterable[int], simple: bool) -> bool:
    """Takes one variable out, by an equation among some; False if none can go.

    Args:
        simple: only by a relation to one other, with a number before.
    """
    best: tuple[float, int, str, int] | None = None
    used = frozenset().union(*(out.graph.leaves(e.node) for e in out.equations))
    # how much one wants to keep a variable: outputs, then states
    keep = {v.name: 2.0 * v.output + (out.graph.leaf(v.name, 1) in used) for v in out.left()}
    inputs = {v.name for v in out.flat.inputs}
    orders = out.orders()
    for number in among:
        node = out.equations[number].node
        leaves = [out.graph.nodes[leaf] for leaf in out.graph.leaves(node)]
        unknown = [at.name for at in leaves if at.name in keep]
        driven = any(at.name in inputs for at in leaves)
        if simple and len(unknown) + driven > 2:
            continue
        for at in leaves:
            if at.order or unknown.count(at.name) != 1 or (driven and orders[at.name]):
                continue
            if orders[at.name] and not _straight(out, node, leaves, orders):
                continue
            # an output that is a constant times a state becomes the state, to be adopted
            shown = keep[at.name] < 2.0 and any(keep.get(name, 0.0) >= 2.0 for name in unknown)
            if best is None or keep[at.name] < best[0]:
                found = _solved(out, node, out.graph.leaf(at.name), simple and not shown)
                best = best if found is None else (keep[at.name], number, at.name, found)
        if best is not None and best[0] == 0.0:
            break
    if best is None:
        return False
    out.replace(best[1], best[2], best[3])
    return True


def _straight(out: Reduced, node: int, leaves: list[Node], orders: dict[str, int]) -> bool:
    """Is the relation linear in what is no state? A state is not given up for a bent one."""
    for at in leaves:
        if at.name in orders and not orders[at.name]:
            slope = out.graph.slope(node, out.graph.leaf(at.name))
            if any(out.graph.nodes[leaf].name in out.moving for leaf in out.graph.leaves(slope)):
                return False
    return True


def _solved(out: Reduced, node: int, leaf: int, simple: bool) -> int | None:
    """The leaf from ``node = 0``; its factor has to be a number (if not simple, a constant)."""
    graph = out.graph
    split = graph.affine(node, leaf)
    if split is None or graph.value(split[0]) == 0.0:
        return None
    number = graph.value(split[0])
    if number is not None:
        return graph("multiply", graph.constant(-1.0 / number), split[1])
    if simple or any(graph.nodes[at].name in out.moving for at in graph.leaves(split[0])):
        return None
    return graph("negate", graph("divide", split[1], split[0]))
