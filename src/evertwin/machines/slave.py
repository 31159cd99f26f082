"""A twin's model as an FMU slave: what a Python FMU made by evertwin runs (PythonFMU, FMI 2.0).

The FMU holds a description of the model (``model.json``), the files that it is built from, and a
script with a class derived from `TwinSlave`. It computes by evertwin itself, which therefore has to
be installed in the Python that loads it. Inputs and outputs keep their names and units; the
model's states are ``state.NAME`` with start values, parameters that tuning may change are tunable.
Before the first step outputs are those of a row of no duration, as the first row of a recording is.

PythonFMU 0.7 gives the namespace of the script back once more than it took it, for each instance:
the second would find an empty module, or crash. So `TwinSlave` takes it as often.

>>> TwinSlave.__name__
'TwinSlave'
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pythonfmu import (
    DefaultExperiment,
    Fmi2Causality,
    Fmi2Initial,
    Fmi2Slave,
    Fmi2Variability,
    Real,
)

from evertwin.machines.catalog import located, machine
from evertwin.models import Model, Parameters
from evertwin.models.configured import configured
from evertwin.models.corrected.corrected import build
from evertwin.models.form import Form
from evertwin.signals.units import conversion, powers
from evertwin.types import Float64, StateVector

DESCRIPTION = "model.json"
_TAKEN: list[object] = []
"""The namespaces of scripts, once an instance."""


class Described(NamedTuple):
    """What ``model.json`` says.

    >>> Described.__name__
    'Described'
    """

    model: Model
    """With its parameter values."""
    start: StateVector | None
    """State that it starts from; None: the model's own."""
    inputs: Float64[np.ndarray, " nu"]
    """That it starts with."""
    step: float | None
    """Usual duration of a row [s]."""


@cache
def described(folder: Path) -> Described:
    """The model that ``model.json`` in a folder describes.

    Raises:
        ModelError, UsageError: it cannot be built.
    """
    content = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
    base = machine(content["kind"], located(folder, content["options"]))
    model = build(base, Form.from_json(content["form"]))
    rows = zip(*(content[key] for key in ("names", "values", "low", "high", "editable")))
    items = [
        replace(
            model.parameters[name], value=value, low=-math.inf if low is None else low,
            high=math.inf if high is None else high, editable=editable,
        )
        for name, value, low, high, editable in rows
    ]  # fmt: skip
    start = None if content["start"] is None else np.array(content["start"])
    made = configured(model, parameters=Parameters(tuple(items)))
    return Described(made, start, np.array(content["inputs"], dtype=np.float64), content["step"])


class TwinSlave(Fmi2Slave):  # type: ignore[misc]
    """Derive from it in a script that lies beside ``model.json``."""

    _namespace: ClassVar[dict[str, Any]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls._namespace = vars(sys.modules[cls.__module__])

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        _TAKEN.append(self._namespace)
        known = described(Path(self.resources))
        self.model, self._start = known.model, known.start
        if known.step is not None:
            self.default_experiment = DefaultExperiment(step_size=known.step)
        self.p = self.model.parameters.values
        self.u = known.inputs.copy()
        self.y = np.zeros(len(self.model.outputs))
        self.x = self._first()
        self._started = self._stepped = False
        self._register()

    def _first(self) -> StateVector:
        """The state that it starts from, moved by what a parameter that was set moves it."""
        own = self.model.initial(self.p)
        if self._start is None:
            return own
        return np.asarray(self._start + own - self.model.initial(self.model.parameters.values))

    def _register(self) -> None:
        model, causality = self.model, Fmi2Causality
        for k, name in enumerate(model.inputs.names):
            self._add(name, self.u, k, causality=causality.input)
        for k, name in enumerate(model.outputs.names):
            self._add(name, self.y, k, self._now, causality=causality.output)
        for k, item in enumerate(model.parameters):
            kind = Fmi2Variability.tunable if item.editable else Fmi2Variability.fixed
            self._add(item.name, self.p, k, causality=causality.parameter, variability=kind)
        for k, name in enumerate(model.states.names):
            self.register_variable(
                Real(
                    f"state.{name}", causality=causality.local, initial=Fmi2Initial.exact,
                    variability=Fmi2Variability.continuous, getter=self._state(k),
                    setter=self._set_state(k),
                ),
                nested=False,
            )  # fmt: skip

    def _now(self) -> None:
        """Outputs before the first step: of a row without duration."""
        if not self._stepped:
            _, y = self.model.simulate(self.x, self.u[None, :], np.zeros(1), self.p)
            self.y[:] = y[0]

    def _add(
        self, name: str, values: np.ndarray, k: int, before: Callable[[], None] | None = None,
        **settings: Any,
    ) -> None:  # fmt: skip
        def get() -> float:
            if before is not None:
                before()
            return float(values[k])

        def put(value: float) -> None:
            values[k] = value

        variable = Real(name, getter=get, setter=put, **settings)
        self.register_variable(variable, nested=False)

    def _state(self, k: int) -> Callable[[], float]:
        return lambda: float(self.x[k])

    def _set_state(self, k: int) -> Callable[[float], None]:
        def put(value: float) -> None:
            if not self._started:
                self.x, self._started = self._first(), True
            self.x[k] = value

        return put

    def exit_initialization_mode(self) -> None:
        """States that were not set follow the parameters that were."""
        if not self._started:
            self.x = self._first()

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One row: the input held over the step, outputs at its end; False where it fails."""
        self.x, y = self.model.simulate(self.x, self.u[None, :], np.array([step_size]), self.p)
        self._started = self._stepped = True
        self.y[:] = y[0]
        return bool(np.isfinite(y).all())

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """PythonFMU's description, with units and bounds."""
        top: Element = super().to_xml(model_options or {})
        model = self.model
        units = {c.name: c.unit for c in (*model.inputs, *model.outputs)}
        units |= {p.name: p.unit for p in model.parameters}
        units |= {f"state.{c.name}": c.unit for c in model.states}
        bounds = {p.name: (p.low, p.high) for p in model.parameters}
        for variable in top.iterfind("ModelVariables/ScalarVariable"):
            real, name = variable.find("Real"), str(variable.get("name"))
            assert real is not None
            if units[name] != "1":
                real.set("unit", units[name])
            for key, bound in zip(("min", "max"), bounds.get(name, ())):
                if np.isfinite(bound):
                    real.set(key, repr(float(bound)))
        definitions = Element("UnitDefinitions")
        for unit in sorted({unit for unit in units.values() if unit != "1"}):
            element, known = SubElement(definitions, "Unit", name=unit), powers(unit)
            told = {key: str(n) for key, n in known.items()}
            for key, size, usual in zip(("factor", "offset"), conversion(unit), (1.0, 0.0)):
                told |= {key: repr(size)} if size != usual else {}
            if told:
                SubElement(element, "BaseUnit", told)
        if len(definitions):
            top.insert([child.tag for child in top].index("CoSimulation") + 1, definitions)
        return top
