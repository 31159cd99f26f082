"""Expressions as a graph of operations: each is written once, however often it is used.

A node is a number (its place in the list), so equal expressions are the same node, and the list in
its order is already a program without branches. Constants fold, and sums and products with 0 and 1
vanish. `Graph.slope` gives exact derivatives, `Graph.affine` splits ``a·v + b``.

>>> g = Graph()
>>> x, k = g.leaf("x"), g.leaf("k")
>>> f = g("multiply", k, g("sin", x))
>>> g.shown(g.slope(f, x))
'(k * cos(x))'
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce
from typing import NamedTuple

import numpy as np

from evertwin.models.modelica.kernel import BINARY, OPS, one


class Node(NamedTuple):
    """An operation over other nodes, a constant or a leaf.

    >>> Node("add", (1, 2)).value
    0.0
    """

    op: str
    args: tuple[int, ...] = ()
    value: float = 0.0
    """Of a constant."""
    name: str = ""
    """Of a leaf."""
    order: int = 0
    """How often a leaf is differentiated by time."""


_SHOWN = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/", "power": "^"}
_FLAT = {"sign", "floor", "ceil", "not", *BINARY[8:]}
"""Operations without a slope."""


def folded(op: str, values: Sequence[float]) -> float:
    """What the kernel makes of numbers; NaN where that is none.

    >>> folded("multiply", [2.0, 3.0]), folded("log", [-1.0])
    (6.0, nan)
    """
    given = (*values, 0.0, 0.0)[:3]
    try:
        with np.errstate(all="ignore"):
            return float(one.plain(OPS.index(op), *given))
    except (ValueError, ArithmeticError):
        return math.nan


@dataclass
class Graph:
    """Nodes, each once; ``g(op, a, b)`` gives the number of a node. See the module for an example.

    >>> g = Graph()
    >>> g("add", g.constant(1.0), g.constant(2.0)) == g.constant(3.0)
    True
    """

    nodes: list[Node] = field(default_factory=list)
    _known: dict[Node, int] = field(default_factory=dict)
    _slopes: dict[tuple[int, int], int] = field(default_factory=dict)
    _leaves: dict[int, frozenset[int]] = field(default_factory=dict)

    def _add(self, node: Node) -> int:
        found = self._known.get(node)
        if found is None:
            found = self._known[node] = len(self.nodes)
            self.nodes.append(node)
        return found

    def constant(self, value: float) -> int:
        """A number."""
        return self._add(Node("constant", value=float(value) + 0.0))

    def leaf(self, name: str, order: int = 0) -> int:
        """A variable, or its time derivative of some order."""
        return self._add(Node("leaf", name=name, order=order))

    def __call__(self, op: str, *args: int) -> int:
        """The node of an operation over nodes: ``select`` takes (condition, then, else)."""
        values = [self.nodes[a].value for a in args if self.nodes[a].op == "constant"]
        if len(values) == len(args):
            return self.constant(folded(op, values))
        return self._simpler(op, args)

    def value(self, node: int) -> float | None:
        """The number that a node is; None if it depends on something."""
        found = self.nodes[node]
        return found.value if found.op == "constant" else None

    def _simpler(self, op: str, args: tuple[int, ...]) -> int:
        a = args[0]
        left = self.value(a)
        if op == "select":
            if left is not None:
                return args[1] if left else args[2]
            return args[1] if args[1] == args[2] else self._add(Node(op, args))
        if len(args) == 1:
            inner = self.nodes[a]
            return inner.args[0] if op == inner.op == "negate" else self._add(Node(op, args))
        b = args[1]
        right = self.value(b)
        if op in ("add", "multiply") and a > b:
            a, b, left, right = b, a, right, left
        found = self._identity(op, (a, left), (b, right))
        return self._add(Node(op, (a, b))) if found is None else found

    def _identity(
        self, op: str, a: tuple[int, float | None], b: tuple[int, float | None]
    ) -> int | None:
        """What an operation with 0 or 1 comes to."""
        for (_, number), other in ((a, b[0]), (b, a[0])):
            if op == "add" and number == 0.0:
                return other
            if op == "multiply" and number in (0.0, 1.0, -1.0):
                if number == 0.0:
                    return self.constant(0.0)
                return other if number == 1.0 else self("negate", other)
        if op == "subtract" and b[1] == 0.0:
            return a[0]
        if op == "subtract" and a[1] == 0.0:
            return self("negate", b[0])
        if op == "subtract" and a[0] == b[0]:
            return self.constant(0.0)
        if op == "divide" and a[1] == 0.0:
            return a[0]
        return a[0] if op in ("divide", "power") and b[1] == 1.0 else None

    def sum(self, items: Iterable[int]) -> int:
        """The sum of nodes."""
        return reduce(partial(self, "add"), items, self.constant(0.0))

    def leaves(self, node: int) -> frozenset[int]:
        """The leaves that a node depends on."""
        found = self._leaves.get(node)
        if found is not None:
            return found
        for i in self.program([node]):
            if i not in self._leaves:
                at = self.nodes[i]
                parts = (self._leaves[a] for a in at.args)
                self._leaves[i] = frozenset([i]) if at.op == "leaf" else frozenset().union(*parts)
        return self._leaves[node]

    def program(self, roots: Iterable[int]) -> list[int]:
        """All nodes that the roots are made of, in the order in which they can be computed."""
        found: set[int] = set()
        stack = list(roots)
        while stack:
            node = stack.pop()
            if node not in found:
                found.add(node)
                stack.extend(self.nodes[node].args)
        return sorted(found)

    def mapped(self, root: int, replace: Mapping[int, int]) -> int:
        """The expression with leaves replaced by other expressions."""
        if not replace or self.leaves(root).isdisjoint(replace):
            return root
        new: dict[int, int] = {}
        for i in self.program([root]):
            node = self.nodes[i]
            args = tuple(new[a] for a in node.args)
            new[i] = (
                replace[i] if i in replace else self(node.op, *args) if args != node.args else i
            )
        return new[root]

    def slope(self, node: int, leaf: int) -> int:
        """∂node/∂leaf."""
        if leaf not in self.leaves(node):
            return self.constant(0.0)
        for i in self.program([node]):
            if (i, leaf) not in self._slopes:
                self._slopes[i, leaf] = self._one(i, leaf)
        return self._slopes[node, leaf]

    def _one(self, i: int, leaf: int) -> int:
        node = self.nodes[i]
        if i == leaf:
            return self.constant(1.0)
        if leaf not in self.leaves(i) or node.op in _FLAT:
            return self.constant(0.0)
        if node.op == "select":
            c, a, b = node.args
            return self("select", c, self._slopes[a, leaf], self._slopes[b, leaf])
        inner = [self._slopes[a, leaf] for a in node.args]
        outer = self._outer(node.op, node.args, i)
        return self.sum(self("multiply", o, d) for o, d in zip(outer, inner, strict=True))

    def _outer(self, op: str, args: tuple[int, ...], i: int) -> tuple[int, ...]:
        """Slopes of an operation by its arguments."""
        unit, a = self.constant(1.0), args[0]
        if len(args) == 2:
            return self._outer2(op, (a, args[1]), i)
        rules: dict[str, Callable[[], int]] = {
            "negate": lambda: self.constant(-1.0),
            "sin": lambda: self("cos", a),
            "cos": lambda: self("negate", self("sin", a)),
            "tan": lambda: self("add", unit, self("multiply", i, i)),
            "asin": lambda: self("divide", unit, self("sqrt", self._rest(a))),
            "acos": lambda: self("divide", self.constant(-1.0), self("sqrt", self._rest(a))),
            "atan": lambda: self("divide", unit, self("add", unit, self("multiply", a, a))),
            "sinh": lambda: self("cosh", a),
            "cosh": lambda: self("sinh", a),
            "tanh": lambda: self._rest(i),
            "exp": lambda: i,
            "log": lambda: self("divide", unit, a),
            "log10": lambda: self("divide", self.constant(1.0 / math.log(10.0)), a),
            "sqrt": lambda: self("divide", self.constant(0.5), i),
            "abs": lambda: self("sign", a),
        }
        return (rules[op](),)

    def _rest(self, a: int) -> int:
        """1 − a²."""
        return self("subtract", self.constant(1.0), self("multiply", a, a))

    def _outer2(self, op: str, args: tuple[int, int], i: int) -> tuple[int, int]:
        unit, (a, b) = self.constant(1.0), args
        if op in ("add", "subtract"):
            return unit, self.constant(1.0 if op == "add" else -1.0)
        if op == "multiply":
            return b, a
        if op == "divide":
            return self("divide", unit, b), self("negate", self("divide", i, b))
        if op == "power":
            less = self("power", a, self("subtract", b, unit))
            grows = self.constant(0.0)
            if self.value(b) is None:
                grows = self("multiply", i, self("log", a))
            return self("multiply", b, less), grows
        if op == "atan2":
            size = self("add", self("multiply", a, a), self("multiply", b, b))
            return self("divide", b, size), self("negate", self("divide", a, size))
        first = self("less_equal" if op == "min" else "greater_equal", a, b)
        return first, self("not", first)

    def affine(self, node: int, leaf: int) -> tuple[int, int] | None:
        """(a, b) with node = a·leaf + b, neither depending on the leaf; None if it is not."""
        if leaf not in self.leaves(node):
            return self.constant(0.0), node
        a = self.slope(node, leaf)
        if leaf in self.leaves(a) or self.value(a) == 0.0:
            return None
        return a, self.mapped(node, {leaf: self.constant(0.0)})

    def shown(self, node: int) -> str:
        """The expression as text, for messages."""
        at = self.nodes[node]
        if at.op == "constant":
            return f"{at.value:g}"
        if at.op == "leaf":
            return at.name if not at.order else f"{'der(' * at.order}{at.name}{')' * at.order}"
        parts = [self.shown(a) for a in at.args]
        if at.op in _SHOWN:
            return f"({f' {_SHOWN[at.op]} '.join(parts)})"
        return f"{at.op}({', '.join(parts)})"

    def evaluate(self, roots: list[int], values: Mapping[int, float]) -> list[float]:
        """Numbers of the roots with the leaves' values."""
        known = dict(values)
        for i in self.program(roots):
            node, given = self.nodes[i], [known[a] for a in self.nodes[i].args]
            if i not in known:
                known[i] = folded(node.op, given) if given else node.value
        return [known[root] for root in roots]
