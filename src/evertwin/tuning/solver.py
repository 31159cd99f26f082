"""One call: the right solver for the problem, the gate before it, the record after it.

All tuned parameters linear: closed form. Some of them: variable projection. None: SciPy's
nonlinear least squares on roll-outs.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from evertwin.models import LinearModel, Parameters
from evertwin.tuning.assemble import Outcome, assemble, judge, noise_of
from evertwin.tuning.closed import ClosedForm
from evertwin.tuning.fit import Fit
from evertwin.tuning.identifiability import connected
from evertwin.tuning.mixed import project, separable
from evertwin.tuning.nonlinear import least_squares
from evertwin.tuning.problem import PerOutput, Problem
from evertwin.tuning.settings import Settings
from evertwin.types import ParameterVector, Vector

__all__ = ["solve"]


def solve(
    problem: Problem, p0: ParameterVector | None = None, settings: Settings | None = None
) -> Fit:
    """Tunes the problem's parameters.

    Args:
        problem: what to tune, on what.
        p0: full parameter vector to start from; default: the problem's own values.
        settings: of the nonlinear search; default: the problem's.

    Raises:
        ModelError: a tuned parameter changes no output (the knob is not connected).
    """
    began = time.perf_counter()
    if p0 is not None:
        problem = replace(problem, prior=_started(problem.parameters, p0))
    # a simulation that runs away is infinite, not an accident: the fit says that it diverged
    with np.errstate(over="ignore", invalid="ignore"):
        if problem.linear and problem.loss == "linear":
            return _linear(problem, began)
        return _search(problem, settings or problem.settings, began)


def _started(parameters: Parameters, p0: ParameterVector) -> Parameters:
    return parameters.with_values(p0)


def _linear(problem: Problem, began: float) -> Fit:
    model = problem.model
    assert isinstance(model, LinearModel)
    scale = () if problem.scale is None else tuple(problem.scale.tolist())
    plan = ClosedForm(model, problem.names, problem.parameters, scale)
    y0, phi = problem.regressor(problem.start)
    solution = plan.solve_rows(problem.rows.y, y0, phi)
    j = problem.jacobian(problem.start)
    _check_knobs(problem, j)
    values = solution.values
    hit: tuple[str, ...] = ()
    low, high = problem.bounds
    if ((values < low) | (values > high)).any():
        values, hit = _bounded(problem, j, solution.noise)
    message = "solved" if not hit else f"solved; {', '.join(hit)} on a bound"
    return assemble(problem, Outcome(values, 1, 1, True, message, hit), problem.start, j, began)


def _bounded(problem: Problem, j: Any, sigma: PerOutput) -> tuple[Vector, tuple[str, ...]]:
    """Linear least squares inside the bounds, on the triangular factor of the rows."""
    used = problem.rows.used
    weight = 1.0 / np.where(sigma > 0, sigma, 1.0)
    a = (np.where(used[:, :, None], j, 0.0) * weight[:, None])[used]
    b = (problem.residuals(problem.start) * weight)[used]
    prior = np.diag(np.sqrt(problem.information))
    both = np.concatenate([np.column_stack([a, b]), np.column_stack([prior, np.zeros(len(prior))])])
    root = np.asarray(np.linalg.qr(both, mode="r"))
    size = np.sqrt(np.square(root[:, :-1]).sum(axis=0))
    size[size == 0] = 1.0
    low, high = problem.bounds
    bounds = (low - problem.start) * size, (high - problem.start) * size
    result = scipy.optimize.lsq_linear(
        root[:, :-1] / size, root[:, -1], bounds=bounds, method="bvls"
    )
    values = np.clip(problem.start + result.x / size, low, high)
    hit = tuple(n for n, on in zip(problem.names, result.active_mask, strict=True) if on)
    return values, hit


def _search(problem: Problem, settings: Settings, began: float) -> Fit:
    j = problem.jacobian(problem.start)
    held = ("",) * len(problem.names)
    if np.isfinite(j[problem.rows.used]).all():
        _check_knobs(problem, j)
        r = problem.residuals(problem.start)
        before = judge(problem, j, noise_of(problem, r, np.zeros(r.shape[1])), problem.start)
        # Collinear parameters take part, so that the others stay unbiased; they are put back after.
        held = tuple(r if r.startswith("not excited") else "" for r in before.reasons)
    free = np.array([not reason for reason in held])
    if separable(problem) and problem.loss == "linear":
        outcome = project(problem, settings, free)
    else:
        outcome = least_squares(problem, settings, free)
    if not np.isfinite(problem.residuals(outcome.values)[problem.rows.used]).all():
        return _diverged(problem, outcome, began)
    end = problem.jacobian(outcome.values)
    return assemble(problem, outcome._replace(held=held), problem.start, end, began)


def _check_knobs(problem: Problem, j: Any) -> None:
    """A column of zeros is asked whether its parameter acts anywhere."""
    acts = np.abs(np.where(problem.rows.used[:, :, None], j, 0.0)).sum(axis=(0, 1)) > 0
    silent = tuple(name for name, on in zip(problem.names, acts, strict=True) if not on)
    if silent:
        connected(problem.model, silent, problem.rows.u)


def _diverged(problem: Problem, outcome: Outcome, began: float) -> Fit:
    """Nothing was learned: every value stays, every interval is infinite."""
    nothing = np.zeros((*problem.rows.y.shape, len(problem.names)))
    held = ("the simulation diverged",) * len(problem.names)
    with np.errstate(over="ignore", invalid="ignore"):
        return assemble(problem, outcome._replace(held=held), problem.start, nothing, began)
