"""The joint of `twins/joint.toml` in motion: recordings with a truth that is known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from evertwin import Twin
from evertwin.models.spec import ParameterSpec
from planted.twins import opened, shipped

RATE = 50.0
COPPER = 0.0039
"""Rise of a copper winding's resistance [1/K]."""


def motion(seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Time, and speed and acceleration of the joint: sweeps of several speeds, both ways."""
    t = np.arange(0.0, seconds, 1.0 / RATE)
    w = 2 * np.pi * np.array([0.11, 0.29, 0.47])
    v = (np.array([0.8, 0.5, 0.3]) * np.sin(np.outer(t, w))).sum(axis=1)
    return t, np.column_stack([v, np.gradient(v, t)])


def joint(values: Mapping[str, float] | None = None, measure: str = "effort", **of: Any) -> Twin:
    """The joint with these parameter values; ``of``: options of its gearbox."""
    options: Any = {**shipped("joint").model.options, "measure": measure}
    motor, gearbox, arm = options["components"]
    options["components"] = [motor, {**gearbox, **of}, arm]
    given = {name: ParameterSpec(value=value) for name, value in (values or {}).items()}
    more = ("gearbox.Fc_T", "gearbox.Fv_T") if "temperature" in of else ()
    editable = ("gearbox.Fc", "gearbox.Fv", *more)
    model = {"options": options, "parameters": given}
    return opened("joint", model=model, tuning={"editable": editable})


def measured(twin: Twin, t: np.ndarray, u: np.ndarray, noise: np.ndarray) -> dict[str, np.ndarray]:
    """What the joint shows in this motion, with noise."""
    model = twin.model
    p = model.parameters.values
    y = model.simulate(model.initial(p), u, np.full(len(t), 1.0 / RATE), p)[1][:, 0]
    return {"t": t, **dict(zip(model.inputs.names, u.T)), model.outputs.names[0]: y + noise}
