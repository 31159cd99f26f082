"""A twin's model as an FMU slave: what a Python FMU made by evertwin runs (PythonFMU, FMI 2.0).

The FMU holds a description of the model (``model.json``), the files that it is built from, and a
script with a class derived from `TwinSlave`. It computes by evertwin itself, which therefore has to
be installed in the Python that loads it. Inputs and outputs keep their names and units; the
model's states are ``state.NAME`` with start values, parameters that tuning may change are tunable.

>>> TwinSlave.__name__
'TwinSlave'
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real

from evertwin.machines.catalog import located, machine
from evertwin.models import Model, Parameters
from evertwin.models.configured import configured
from evertwin.models.corrected import build
from evertwin.models.form import Form
from evertwin.signals.units import conversion, powers

DESCRIPTION = "model.json"


@cache
def described_model(folder: Path) -> Model:
    """The model that ``model.json`` in a folder describes, with its parameter values.

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
    return configured(model, parameters=Parameters(tuple(items)))


class TwinSlave(Fmi2Slave):  # type: ignore[misc]
    """Derive from it, and set ``folder`` to where ``model.json`` lies."""

    folder: ClassVar[Path]

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.model = described_model(self.folder)
        self.p = self.model.parameters.values
        self.u = np.zeros(len(self.model.inputs))
        self.y = np.zeros(len(self.model.outputs))
        self.x = self.model.initial(self.p)
        self._started = False
        self._register()

    def _register(self) -> None:
        model, causality = self.model, Fmi2Causality
        for k, name in enumerate(model.inputs.names):
            self._add(name, self.u, k, causality=causality.input)
        for k, name in enumerate(model.outputs.names):
            self._add(name, self.y, k, causality=causality.output)
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

    def _add(self, name: str, values: np.ndarray, k: int, **settings: Any) -> None:
        def get() -> float:
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
                self.x, self._started = self.model.initial(self.p), True
            self.x[k] = value

        return put

    def exit_initialization_mode(self) -> None:
        """Without start values the states are the model's own, at the parameters that were set."""
        if not self._started:
            self.x = self.model.initial(self.p)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One row: the input held over the step, outputs at its end; False where it fails."""
        self.x, y = self.model.simulate(self.x, self.u[None, :], np.array([step_size]), self.p)
        self._started = True
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
