"""The compiler's table of expressions, evaluated into nodes: arrays and functions spelled out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce
from itertools import product
from typing import Any

import numpy as np

from evertwin.errors import ModelError
from evertwin.models.modelica.graph import Graph
from evertwin.models.modelica.kernel import BINARY, UNARY

_ELEMENTWISE = {
    "elementwise_add": "add", "elementwise_subtract": "subtract",
    "elementwise_multiply": "multiply", "elementwise_divide": "divide",
    "elementwise_power": "power",
}  # fmt: skip
_SAME = ("no_event", "smooth", "homotopy", "scalar", "vector")
"""Built-in functions whose value is one of their arguments."""
_QUOTIENTS = ("div", "mod", "rem")


@dataclass(frozen=True)
class Scope:
    """What names mean inside a loop or a function.

    >>> Scope().binders
    {}
    """

    binders: Mapping[tuple[int, int], float] = field(default_factory=dict)
    arguments: Sequence[np.ndarray] = ()
    values: Mapping[int, np.ndarray] = field(default_factory=dict)
    """Definitions of a function's variables, by their ordinal."""


class Arena:
    """Expressions of one model by number.

    >>> Arena.__name__
    'Arena'
    """

    def __init__(
        self, graph: Graph, dae: Mapping[str, Any], value_of: Callable[[str, int, str], np.ndarray]
    ) -> None:
        self.graph, self._variable = graph, value_of
        store = dae["storage"]
        self._nodes, self._said = store["expressions"]["nodes"], store["expressions"]["provenance"]
        self._domains, self._functions = store["domains"], store["functions"]
        self._sources = {one[0]: (one[1], one[2].encode()) for one in dae["source_map"]["files"]}
        self._operands = _runs(self._nodes, "operand_count", store["expressions"]["operands"])
        self._subscripts = _runs(self._nodes, "subscript_count", store["expressions"]["subscripts"])
        self._depth = 0

    def place(self, provenance: Any) -> str:
        """``file:line`` of a piece of the model."""
        span = (provenance or {}).get("span")
        if not span or span["source"] not in self._sources:
            return "model"
        name, text = self._sources[span["source"]]
        return f"{name}:{text[: span['start']].count(10) + 1}"

    def defaulted(self, at: int) -> bool:
        """Was this value filled in by the compiler, not by the model?"""
        return isinstance(self._said[at]["origin"], Mapping)

    def ranges(self, number: int) -> list[range]:
        """The values of a loop's counters."""
        bound = self._domains[number]["domain"]["binders"]
        return [
            range(b["lower"], b["upper"] + (1 if b["step"] > 0 else -1), b["step"]) for b in bound
        ]

    def value(self, at: int, scope: Scope) -> np.ndarray:
        """Nodes of the expression ``at``, in its shape.

        Raises:
            ModelError: it is not understood.
        """
        node = self._nodes[at]
        kind, content = next(iter(node.items())) if isinstance(node, Mapping) else (node, None)
        rule = getattr(self, f"_{kind}", None)
        if rule is None:
            raise self._unknown(at, str(kind))
        return np.asarray(rule(at, content, scope), dtype=np.int64)

    def _unknown(self, at: int, what: str) -> ModelError:
        return ModelError(
            f"{self.place(self._said[at])}: {what!r} is not understood here: write it with "
            "operations of smooth models, or take OpenModelica (via)"
        )

    def _all(self, at: int, scope: Scope) -> list[np.ndarray]:
        return [self.value(one, scope) for one in self._operands.get(at, ())]

    def _literal(self, at: int, content: Any, scope: Scope) -> Any:
        ((kind, value),) = content.items()
        if kind not in ("real", "integer", "boolean", "enumeration"):
            raise self._unknown(at, f"literal {kind}")
        return self.graph.constant(float(value))

    def _coordinate(self, at: int, content: Any, scope: Scope) -> Any:
        if not isinstance(content, Mapping):
            content = {str(content): None}
        ((kind, value),) = content.items()
        if kind == "binder":
            return self.graph.constant(scope.binders[value["domain"], value["ordinal"]])
        if kind == "function_parameter":
            return scope.arguments[value["ordinal"]]
        if kind == "time":
            raise ModelError(
                f"{self.place(self._said[at])}: depends on time: rows may be cut anywhere, so give "
                "what depends on time as an input"
            )
        if kind not in ("state", "derivative", "algebraic", "input", "parameter", "output"):
            raise self._unknown(at, kind)
        return self._variable(kind, int(value), self.place(self._said[at]))

    def _binary(self, at: int, content: Any, scope: Scope) -> Any:
        a, b = self.value(content["lhs"], scope), self.value(content["rhs"], scope)
        op = content["operator"]
        if op == "multiply" and a.ndim and b.ndim:
            return self._matrix_product(a, b)
        op = _ELEMENTWISE.get(op, op)
        if op not in BINARY:
            raise self._unknown(at, op)
        return self._each(op, a, b)

    def _matrix_product(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        rows = a.reshape(-1, a.shape[-1])
        columns = b.reshape(b.shape[0], -1).T
        out = [[self._dot(row, column) for column in columns] for row in rows]
        return np.array(out, dtype=np.int64).reshape(a.shape[:-1] + b.shape[1:])

    def _dot(self, a: np.ndarray, b: np.ndarray) -> int:
        return self.graph.sum(self._each("multiply", a, b).ravel().tolist())

    def _each(self, op: str, *args: np.ndarray) -> np.ndarray:
        """An operation element by element."""
        each = np.frompyfunc(partial(self.graph, op), len(args), 1)
        return np.asarray(each(*args), dtype=np.int64)

    def _unary(self, at: int, content: Any, scope: Scope) -> Any:
        a, op = self.value(content["operand"], scope), content["operator"]
        if op in ("plus", "elementwise_plus"):
            return a
        op = "negate" if op.endswith("negate") else op
        if op not in ("negate", "not"):
            raise self._unknown(at, op)
        return self._each(op, a)

    def _conditional(self, at: int, content: Any, scope: Scope) -> Any:
        parts = self._all(at, scope)
        value = parts[-1]
        for k in range(len(parts) - 3, -1, -2):
            value = self._each("select", parts[k], parts[k + 1], value)
        return value

    def _array(self, at: int, content: Any, scope: Scope) -> Any:
        return np.stack(self._all(at, scope))

    def _range(self, at: int, content: Any, scope: Scope) -> Any:
        said = content["explicit_step_expression"]
        first, last = (
            self._number(content[key], scope) for key in ("start_expression", "stop_expression")
        )
        step = 1.0 if said is None else self._number(said, scope)
        count = int(np.floor((last - first) / step + 1e-9)) + 1
        return np.array([self.graph.constant(first + k * step) for k in range(count)])

    def _number(self, at: int, scope: Scope) -> float:
        """A value that has to be known before the run, as a size or an index."""
        node = int(self.value(at, scope))
        found = self.graph.value(node)
        if found is None:
            raise ModelError(
                f"{self.place(self._said[at])}: {self.graph.shown(node)} must be a number that is "
                "known before the run: declare it final or as an Integer parameter"
            )
        return found

    def _index(self, at: int, content: Any, scope: Scope) -> Any:
        base = self.value(content["base"], scope)
        for axis in range(len(self._subscripts[at]) - 1, -1, -1):
            said = self._subscripts[at][axis]["kind"]
            if said in ("whole", "colon") or said == {"whole": None}:
                continue
            kind, inner = next(iter(said.items())) if isinstance(said, Mapping) else (said, 0)
            if kind == "index":
                base = np.take(base, int(self._number(inner, scope)) - 1, axis)
            elif kind == "slice":
                numbers = [self.graph.value(int(i)) for i in self.value(inner, scope)]
                base = np.take(base, [int(n or 0) - 1 for n in numbers], axis)
            else:
                raise self._unknown(at, f"subscript {kind}")
        return base

    def _comprehension(self, at: int, content: Any, scope: Scope) -> Any:
        number = content["domain"]
        ranges = self.ranges(number)
        items = []
        for values in product(*ranges):
            bound = {(number, k): float(value) for k, value in enumerate(values)}
            inner = Scope({**scope.binders, **bound}, scope.arguments, scope.values)
            items.append(self.value(content["body"], inner))
        return np.stack(items).reshape(tuple(len(r) for r in ranges) + items[0].shape)

    def _call(self, at: int, content: Any, scope: Scope) -> Any:
        function = self._functions[content["function"]]
        if function["external"] is not None:
            raise self._unknown(at, f"external function {function['name']}")
        self._depth += 1
        if self._depth > 50:
            raise ModelError(f"{self.place(self._said[at])}: {function['name']} calls itself")
        values: dict[int, np.ndarray] = {}
        inner, newest = Scope(arguments=self._all(at, scope), values=values), {}
        for statement in function["statements"]:
            kind, said = next(iter(statement.items()))
            if kind not in ("assignment", "assignment_group"):
                raise self._unknown(at, f"statement {kind} in {function['name']}")
            for one in [said] if kind == "assignment" else said["assignments"]:
                newest[one["target"]] = self.value(one["rhs"], inner)
                values[len(values)] = newest[one["target"]]
        self._depth -= 1
        return newest[content["output"]]

    def _function_value(self, at: int, content: Any, scope: Scope) -> Any:
        return scope.values[content["definition_ordinal"]]

    def _builtin(self, at: int, content: Any, scope: Scope) -> Any:
        name, args = content["builtin"], self._all(at, scope)
        if name in ("min", "max", "sum", "product") and len(args) == 1:
            return self._reduced(name, args[0])
        if name in UNARY and len(args) == 1:
            return self._each(name, args[0])
        if name in BINARY and len(args) == 2:
            return self._each(name, *args)
        if name in _SAME:
            return (
                args[1] if name == "smooth" else args[0].reshape(_SHAPES.get(name, args[0].shape))
            )
        if name.startswith("promoted_cat"):
            axis = int(name.removeprefix("promoted_cat")) - 1
            two = [a.reshape(a.shape + (1,) * (2 - a.ndim)) for a in args]
            return np.concatenate(two, axis)
        if name in ("zeros", "ones", "fill", "identity", "diagonal", "transpose", "cross"):
            return self._arrays(name, args, at, scope)
        if name == "integer":
            return self._each("floor", args[0])
        raise self._unknown(at, f"{name}()")

    def _reduced(self, name: str, items: np.ndarray) -> int:
        nodes = items.ravel().tolist()
        if name == "sum":
            return self.graph.sum(nodes)
        op = "multiply" if name == "product" else name
        return int(reduce(partial(self.graph, op), nodes))

    def _arrays(self, name: str, args: list[np.ndarray], at: int, scope: Scope) -> Any:
        zero, one = self.graph.constant(0.0), self.graph.constant(1.0)
        if name == "transpose":
            return args[0].T
        if name == "cross":
            turns = [1, 2, 0], [2, 0, 1]
            parts = [
                self._each("multiply", args[0][i], args[1][j]) for i, j in (turns, turns[::-1])
            ]
            return self._each("subtract", *parts)
        if name == "diagonal":
            return np.where(np.eye(len(args[0]), dtype=np.bool_), args[0][:, None], zero)
        first = 1 if name == "fill" else 0
        sizes = [int(self._number(i, scope)) for i in self._operands[at][first:]]
        if name == "identity":
            return np.where(np.eye(sizes[0], dtype=np.bool_), one, zero)
        filler = args[0] if name == "fill" else np.asarray(one if name == "ones" else zero)
        return np.broadcast_to(filler, (*sizes, *filler.shape))

    def _runtime_quotient_owner(self, at: int, content: Any, scope: Scope) -> Any:
        a, b = self.value(content["lhs"], scope), self.value(content["rhs"], scope)
        ratio, name = self._each("divide", a, b), content["builtin"]
        if name not in _QUOTIENTS:
            raise self._unknown(at, f"{name}()")
        whole = self._each("floor", ratio)
        if name != "mod":
            zero = np.asarray(self.graph.constant(0.0))
            down = self._each("greater_equal", ratio, zero)
            whole = self._each("select", down, whole, self._each("ceil", ratio))
        if name == "div":
            return whole
        return self._each("subtract", a, self._each("multiply", whole, b))


_SHAPES: Mapping[str, tuple[int, ...]] = {"scalar": (), "vector": (-1,)}


def _runs(nodes: Sequence[Any], key: str, items: Sequence[Any]) -> dict[int, Sequence[Any]]:
    """The items of each node: they stand one after the other, in the order of the nodes."""
    out: dict[int, Sequence[Any]] = {}
    at = 0
    for number, node in enumerate(nodes):
        content = next(iter(node.values())) if isinstance(node, Mapping) else None
        if isinstance(content, Mapping) and key in content:
            out[number] = items[at : at + content[key]]
            at += content[key]
    return out
