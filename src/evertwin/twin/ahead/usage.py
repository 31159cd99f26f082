"""How fast a component wears under other work: the work plan simulated with the twin.

Wear of one cycle at a joint is ∫ |τ|^e·|q̇| dt: for e = 1 the way weighted by the load (sliding
parts, Archard), for e = 3 the revolutions by the cube of the load (ball bearings, ISO 281).
The rate of a plan is its wear per unit of the clock over that of the past; a life in the past's
clock is divided by it. Machines without torques wear with their way, or with their time of use.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evertwin.config.prognosis import IndicatorSpec, WorkSpec
from evertwin.config.scenario import LoadSpec, PathSpec, ScenarioSpec, SpeedSpec
from evertwin.prognosis import Life, Workload
from evertwin.signals.units import compatible
from evertwin.twin.ahead.basis import Basis
from evertwin.twin.ahead.changes import Case, changed

__all__ = ["joint_of", "plan_rate", "under", "wear"]


def joint_of(rule: IndicatorSpec, case: Case) -> tuple[int, int] | None:
    """(output, input) columns of torque and speed of the joint that an indicator is about."""
    text = rule.parameter or rule.formula or rule.output or ""
    digits = "".join(c for c in text.partition("+")[0] if c.isdigit())
    outputs, inputs = case.model.outputs.names, case.model.inputs.names
    for torque in (f"tau{digits}", f"i{digits}"):
        if digits and torque in outputs and f"qd{digits}" in inputs:
            return outputs.index(torque), inputs.index(f"qd{digits}")
    return None


def wear(rule: IndicatorSpec, case: Case) -> float:
    """Wear of one cycle in units of its own: only ratios mean something."""
    u, dt = case.future
    joint = joint_of(rule, case)
    if joint is not None:
        _, y = case.model.simulate(case.model.initial(case.p), u, dt, case.p)
        load, speed = np.abs(y[:, joint[0]]), np.abs(u[:, joint[1]])
        return float(np.sum(load**rule.exponent * speed * dt))
    ways = [k for k, c in enumerate(case.model.inputs)
            if any(compatible(c.unit, unit) for unit in ("m/s", "rad/s"))]  # fmt: skip
    if ways:
        return float(np.sum(np.abs(u[:, ways]) * dt[:, None]))
    return float(dt.sum())


def plan_rate(
    basis: Basis, case: Case, works: Sequence[WorkSpec], past: float, rule: IndicatorSpec
) -> float:
    """Wear per unit of the clock under the work ahead, over that of the past.

    Args:
        basis: the twin's live version.
        case: the newest recorded task.
        works: the work ahead; empty: as it was.
        past: cycles of the newest task per unit of the clock, so far.
        rule: the indicator.

    Raises:
        UsageError: a load or a speed that this machine cannot have.
    """
    if not works:
        return 1.0
    before = past * wear(rule, case)
    ahead = 0.0
    for work in works:
        told = ScenarioSpec(
            work.name, folder=str(Path(basis.setup.spec.folder)),
            speed=None if work.speed == 1.0 else SpeedSpec(work.speed),
            load=None if work.load == 0.0 else LoadSpec(work.load),
            path=None if work.path is None else PathSpec(file=work.path),
        )  # fmt: skip
        ahead += work.cycles * wear(rule, changed(basis, case, told))
    return ahead / before if before > 0.0 else 1.0


def under(life: Life, rate: float) -> Life:
    """The life when wear goes ``rate`` times as fast: the work left, done at that rate."""
    return life.through(Workload.steady(rate), life.unit)
