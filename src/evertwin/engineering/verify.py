"""Verification of any model: what can be checked is, and what cannot is said.

Every model: the laws of its contract; with a state, half the step and rest. Machines of ours
besides: the arm against MuJoCo and by energy and momentum (`verify_arm`), the drive and the heated
box by their closed forms and by what heat and friction may do, the mobile bases by a closed circle.

>>> from evertwin.machines.mobile import Robot1D
>>> report = verify(Robot1D(), np.ones((20, 1)), np.full(20, 0.1))
>>> report.passed, [check.kind for check in report.not_run]
(True, ['engine'])
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.engineering.verification import Check, VerificationReport
from evertwin.engineering.verify_arm import resists, verify_arm
from evertwin.engineering.verify_machines import closed_forms
from evertwin.errors import LawBroken
from evertwin.machines.arm import Arm
from evertwin.machines.assembly.inverse import StaticInverse
from evertwin.models import Model, check_model
from evertwin.models.configured import configured
from evertwin.types import Inputs, Intervals, Outputs, ParameterVector, StateVector

ROWS = 200
"""Rows that are looked at."""
STEP = 0.01
"""How much of an output's size half the step may change."""
REST = 1e-6
"""How much of an output's size may still change at rest."""


def verify(
    model: Model,
    u: Inputs,
    dt: Intervals,
    p: ParameterVector | None = None,
    x: StateVector | None = None,
    name: str = "",
) -> VerificationReport:
    """All checks of a model.

    Args:
        model: what runs.
        u: rows that it is looked at on, (n, nu); a recording's are best.
        dt: their intervals [s].
        p: parameters; the model's own by default.
        x: state before the first row; the model's own by default.
        name: for the report.
    """
    values = model.parameters.values if p is None else np.array(p)
    start = model.initial(values) if x is None else x
    known = np.isfinite(u).all(axis=1)
    rows, steps = np.ascontiguousarray(u[known][:ROWS]), np.ascontiguousarray(dt[known][:ROWS])
    checks = [_contract(model, rows, steps, values)]
    if isinstance(model, Arm):
        checks += verify_arm(model, u, values)
    else:
        kind = type(model).__name__
        checks.append(
            Check.missing(
                "independent engine", "engine", f"there is no other engine for a {kind} here"
            )
        )
        checks += closed_forms(model, values)
        checks += [resists(model, u[known], values)] if isinstance(model, StaticInverse) else []
    if len(model.states):
        checks += [_halved(model, start, rows, steps, values), _rest(model, start, steps, values)]
    else:
        checks.append(Check.missing("half the step", "numerics", "a static map has no steps"))
    return VerificationReport(name or type(model).__name__, tuple(checks))


def _contract(model: Model, u: Inputs, dt: Intervals, p: ParameterVector) -> Check:
    """The laws of a Model, on these rows and at these parameters."""
    name, said = "laws of the contract", f"{len(u)} rows"
    try:
        tuned = model.parameters.with_values(p)
        check_model(configured(model, parameters=tuned), u, dt)
    except LawBroken as error:
        return Check(name, "contract", 1.0, 0.0, "1", str(error))
    return Check(name, "contract", 0.0, 0.0, "1", said)


def _halved(model: Model, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Check:
    """Each row as two of half its duration: a solver that is fine enough gives the same."""
    _, whole = model.simulate(x, u, dt, p)
    twice = np.repeat(u, 2, axis=0), np.repeat(0.5 * dt, 2)
    _, half = model.simulate(x, *twice, p)
    off, worst = _off(whole, half[1::2])
    said = f"{len(u)} rows; of the range of {model.outputs.names[worst]}"
    return Check("half the step", "numerics", off, STEP, "1", said)


def _off(a: Outputs, b: Outputs) -> tuple[float, int]:
    """Largest difference of an output relative to its range, and of which one."""
    with np.errstate(invalid="ignore"):
        reach = np.ptp(a, axis=0)
        change = np.abs(a - b).max(axis=0)
    shares = np.where(change == 0.0, 0.0, change / np.where(reach > 0.0, reach, np.nan))
    shares = np.where(np.isnan(shares), np.inf, shares)
    worst = int(np.argmax(shares))
    return float(shares[worst]), worst


def _rest(model: Model, x: StateVector, dt: Intervals, p: ParameterVector) -> Check:
    """Inputs held at zero, or as near as is possible: the outputs come to rest or stay bounded."""
    low = np.array([c.low for c in model.inputs])
    high = np.array([c.high for c in model.inputs])
    still = np.clip(0.0, low, high)
    step = float(np.median(dt[dt > 0])) if (dt > 0).any() else 0.01
    rows = 4000
    _, y = model.simulate(x, np.tile(still, (rows, 1)), np.full(rows, step), p)
    parts: Any = [y[: rows // 2], y[rows // 2 :]]
    if not np.isfinite(y).all():
        return Check("rest", "law", np.inf, REST, "1", "the outputs run away with inputs at zero")
    early, late = (np.ptp(part, axis=0) for part in parts)
    size = np.maximum(np.abs(y).max(axis=0), 1e-12)
    # An output that only settles slowly has to settle; one that keeps a constant swing stays so.
    share = float((np.maximum(0.0, late - early) / size).max())
    said = f"{rows * step:.3g} s with inputs at zero: no growing motion"
    return Check("rest", "law", share, REST, "1", said)
