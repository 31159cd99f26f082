"""One linear axis: a breakdown, its model, and rows that a planted truth made."""

from __future__ import annotations

import numpy as np

from evertwin.engineering.breakdown import BREAKDOWN, Breakdown
from evertwin.engineering.compile import ModelPlan, compile_model
from evertwin.engineering.study import modelled
from evertwin.fold import Block, make_block
from evertwin.tuning import Problem

AXIS = """
schema = 1
name = "axis"
about = "a fast belt axis"

[requirements]
accuracy = 0.05
interval = "18 day"

[sensors.tau1]
measures = "motor force"

[like.rubs]
kind = "guide"
axis = 1
options = { friction = "tanh", width = 0.01 }
effect = 4
proneness = 4
data = [{ kind = "kinematic", from = "catalogue" }, { kind = "dynamic", from = "catalogue" }]
sensors = ["tau1"]

[[system]]
name = "mechanical"

[[system.component]]
name = "guide"
like = "rubs"
wear = [
  { effect = "lubricant", parameters = ["Fv"], drift = 0.5 },
  { effect = "abrasion", parameters = ["Fc"], drift = 0.5 },
]
parameters = { Fc = { value = 2, unit = "N" }, Fv = { value = 60, unit = "Ns/m" } }

[[system.component]]
name = "table"
kind = "mass"
axis = 1
effect = 3
proneness = 2
data = [{ kind = "dynamic", from = "CAD" }, { kind = "kinematic", from = "CAD" }]
wear = [{ effect = "dirt that settles", parameters = ["mass"], drift = 0.2 }]
parameters = { mass = { value = 8, unit = "kg" } }

[[system.component]]
name = "motor"
kind = "motor"
axis = 1
effect = 5
proneness = 1
needs = []
wear = [{ effect = "heat", parameters = ["R"], drift = 0.2 }]
parameters = { R = { value = 2, unit = "ohm" }, J = { value = 1e-9, unit = "kgm2" } }

[[system.component]]
name = "screw"
kind = "ballscrew"
axis = 1
options = { friction = "none" }
effect = 2
proneness = 2
parameters = { lead = { value = 0.02, unit = "m", source = "manufacturer" } }
"""
"""Fast and heavily lubricated: what the welding arm keeps (Coulomb) does not matter here, and what
it drops (viscous) does."""
TRUTH = {"guide.Fc": 2.5, "guide.Fv": 80.0, "table.mass": 10.0}


def rows_of(plan: ModelPlan, breakdown: Breakdown, seed: int = 0, n: int = 500) -> Block:
    """Rows at 25 Hz: speed up to 2 m/s, force with noise."""
    t = np.arange(n) * 0.04
    v = 1.2 * np.sin(2.1 * t) + 0.8 * np.sin(5.3 * t + 1.0)
    a = np.gradient(v, t)
    model = plan.model(breakdown.folder)
    stated = {name: float(e["value"]) for name, e in plan.parameters.items() if "value" in e}  # type: ignore[arg-type]
    known = {name: value for name, value in TRUTH.items() if name in model.parameters.names}
    p = model.parameters.with_values(stated | known).values
    u = np.stack([v, a], axis=1)
    _, y = model.simulate(model.initial(p), u, np.full(n, 0.04), p)
    noise = np.random.default_rng(seed).standard_normal(y.shape)
    return make_block(t=(t * 1e9).astype(np.int64), u=u, y=y + 1.0 * noise)


def posed(text: str = AXIS, seed: int = 0) -> tuple[Breakdown, ModelPlan, Problem]:
    """The tuning problem on all parameters of the breakdown."""
    breakdown = BREAKDOWN.parse(text)
    plan = compile_model(breakdown)
    model = plan.model(breakdown.folder)
    stated = {name: float(e["value"]) for name, e in plan.parameters.items() if "value" in e}  # type: ignore[arg-type]
    prior = model.parameters.with_values(stated)
    names = modelled(breakdown, model.parameters.names)
    return breakdown, plan, Problem(model, (rows_of(plan, breakdown, seed),), names, prior=prior)
