"""From the compiler's JSON to scalar equations over one graph.

The compiler keeps arrays, loops and functions; here each becomes what it stands for, element by
element. Only what is listed in this module is understood: any other operation is refused with the
line it stands on, so nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

import numpy as np

from evertwin.errors import ModelError
from evertwin.models.fmu.unit_names import spelled
from evertwin.models.modelica.arena import Arena, Scope
from evertwin.models.modelica.flat import Equation, Flat, Variable, label
from evertwin.models.modelica.graph import Graph

_EVENTS = {
    "discrete_real_equations": "a variable that changes at events",
    "discrete_value_owners": "a variable that changes at events",
    "event_actions": "an action at an event",
    "model_event_transactions": "an action at an event",
    "time_events": "an event in time",
    "clocks": "a clock",
    "previous_values": "a value before an event",
    "delays": "delay()",
}


def read_flat(found: Mapping[str, Any]) -> Flat:
    """The flat model in what the compiler gave.

    Raises:
        ModelError: an event, a time dependence or an operation that is not understood, with its
            line.
    """
    return _Reader(found).flat()


class _Reader:
    """Reads one model."""

    def __init__(self, found: Mapping[str, Any]) -> None:
        self.graph = Graph()
        self.name = str(found["name"])
        self.store = found["dae"]["storage"]
        self.arena = Arena(self.graph, found["dae"], self._value)
        self.variables: list[Mapping[str, Any]] = self.store["variables"]
        self.known: dict[int, np.ndarray] = {}
        self.tuned: list[int] = []
        self.open: list[int] = []

    def flat(self) -> Flat:
        self._no_events()
        for i in range(len(self.variables)):
            self._value("", i, "")
        unknowns = self._scalars(self._of("state", "algebraic", "output"))
        equations = tuple(self._equations(self.store["continuous_equation_operations"]))
        initial = tuple(self._equations(self.store["initialization_equation_operations"]))
        roots = [root["root"]["provenance"] for root in self.store["roots"] if "root" in root]
        notes = tuple(dict.fromkeys(self.arena.place(at) for at in roots))
        return Flat(
            self.name, self.graph, unknowns, self._scalars(self._of("input")),
            self._scalars(self.tuned), equations, initial, notes,
        )  # fmt: skip

    def _no_events(self) -> None:
        for v in self.variables:
            if v["role"].startswith("discrete"):
                self._refuse(v["declaration"], f"{v['name']} changes at events")
        for key, what in _EVENTS.items():
            for item in self.store.get(key) or ():
                self._refuse(_provenance(item), what)

    def _refuse(self, provenance: Any, what: str) -> None:
        raise ModelError(
            f"{self.arena.place(provenance)}: {what}: models with events are not stepped here; "
            "write it smoothly (tanh in place of a sign), or take OpenModelica (via)"
        )

    def _shape(self, variable: Mapping[str, Any]) -> tuple[int, ...]:
        kind = self.store["value_types"][variable["value_type"]]
        if kind["record_name"]:
            raise ModelError(
                f"{self._declared(variable)}: records are not understood: take them apart"
            )
        return tuple(int(n) for n in kind["dimensions"])

    def _declared(self, variable: Mapping[str, Any]) -> str:
        return self.arena.place(variable["declaration"])

    def _value(self, kind: str, i: int, place: str) -> np.ndarray:
        """Nodes of variable ``i``, in its shape; of its derivative for ``kind = derivative``."""
        variable = self.variables[i]
        if kind == "derivative":
            return self._leaves(variable, 1)
        if i not in self.known:
            if i in self.open:
                raise ModelError(f"{place}: {variable['name']} depends on itself")
            self.open.append(i)
            self.known[i] = self._made(i, variable)
            self.open.pop()
        return self.known[i]

    def _made(self, i: int, variable: Mapping[str, Any]) -> np.ndarray:
        if variable["role"] not in ("parameter", "constant"):
            return self._leaves(variable, 0)
        nodes = self._start(variable)
        if nodes is None:
            raise ModelError(
                f"{self._declared(variable)}: parameter {variable['name']} has no value: give one"
            )
        real = self.store["value_types"][variable["value_type"]]["scalar"] == "real"
        free = variable["role"] == "parameter" and variable["attributes"]["is_tunable"]
        if not (real and free):
            return nodes
        if any(self.graph.value(int(node)) is None for node in nodes.ravel()):
            return nodes  # follows from other parameters
        self.tuned.append(i)
        return self._leaves(variable, 0)

    def _bounds(self, variable: Mapping[str, Any]) -> tuple[float, float]:
        """Smallest and largest value as declared; of an array, of any of its elements."""
        ends = []
        for key, rule, none in (("min", np.min, -np.inf), ("max", np.max, np.inf)):
            at = variable["attributes"][key]
            nodes = [] if at is None else np.asarray(self.arena.value(at, Scope())).ravel().tolist()
            values = [self.graph.value(int(node)) for node in nodes]
            known = [value for value in values if value is not None]
            ends.append(float(rule(known)) if known else none)
        return ends[0], ends[1]

    def _leaves(self, variable: Mapping[str, Any], order: int) -> np.ndarray:
        shape = self._shape(variable)
        out = np.empty(shape, dtype=np.int64)
        for index in np.ndindex(shape):
            name = label(variable["name"], tuple(i + 1 for i in index))
            out[index] = self.graph.leaf(name, order)
        return out

    def _of(self, *roles: str) -> list[int]:
        return [i for i, variable in enumerate(self.variables) if variable["role"] in roles]

    def _scalars(self, numbers: list[int]) -> tuple[Variable, ...]:
        """The elements of variables, as scalars."""
        out = []
        for i in numbers:
            variable, nodes = self.variables[i], self.known[i]
            attributes, start = variable["attributes"], self._start(variable)
            shown = attributes["declared_causality"] == "output" and "." not in variable["name"]
            for index in np.ndindex(nodes.shape):
                node = int(nodes[index])
                out.append(Variable(
                    self.graph.nodes[node].name, node, spelled(attributes["unit"]),
                    *self._bounds(variable), None if start is None else int(start[index]), shown,
                    self._declared(variable), str(attributes["description"] or ""),
                ))  # fmt: skip
        return tuple(out)

    def _start(self, variable: Mapping[str, Any]) -> np.ndarray | None:
        """Its value before the run, of a parameter its value; None: the model gives none."""
        attributes = variable["attributes"]
        fixed = variable["role"] in ("parameter", "constant")
        bound = attributes["binding"] if fixed else None
        at = attributes["start"] if bound is None else bound
        if at is None or self.arena.defaulted(at):
            return None
        return np.broadcast_to(self.arena.value(at, Scope()), self._shape(variable))

    def _equations(self, operations: Any) -> Iterator[Equation]:
        for operation in operations:
            kind, content = next(iter(operation.items()))
            place = self.arena.place(content["provenance"])
            if kind == "residual":
                yield from self._rows(content["residual"], Scope(), place)
            elif kind == "structured":
                yield from self._structured(content, place)
            else:
                raise ModelError(f"{place}: an equation of kind {kind} is not understood")

    def _structured(self, content: Mapping[str, Any], place: str) -> Iterator[Equation]:
        """Equations of a loop, or of whole arrays."""
        bodies, view = content["bodies"], content["scalar_view"]
        if view == "RowMajorProjection":
            for body in bodies:
                yield from self._rows(body, Scope(), place)
            return
        if view != "BinderSubstitution":
            raise ModelError(f"{place}: a loop of kind {view} is not understood")
        number = content["domain"]
        for values in product(*self.arena.ranges(number)):
            bound = {(number, k): float(value) for k, value in enumerate(values)}
            for body in bodies:
                yield from self._rows(body, Scope(binders=bound), place)

    def _rows(self, at: int, scope: Scope, place: str) -> Iterator[Equation]:
        for node in np.asarray(self.arena.value(at, scope)).ravel().tolist():
            yield Equation(int(node), place)


def _provenance(item: Any) -> Any:
    """The first place that is named in ``item``; None: none is."""
    if isinstance(item, Mapping) and "span" in item:
        return item
    inside = item.values() if isinstance(item, Mapping) else item if isinstance(item, list) else ()
    return next((found for found in map(_provenance, inside) if found is not None), None)
