"""One call: the right solver for the problem, the gate before it, the record after it.

All tuned parameters linear: closed form. Some of them: variable projection. None: SciPy's
nonlinear least squares on roll-outs.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import scipy

from evertwin.errors import DataError, ModelError
from evertwin.models.batch import is_native
from evertwin.models.corrected.corrected import Corrected
from evertwin.signals import wrap
from evertwin.tuning.intervals.assemble import Outcome, assemble, noise_of, sizes_of, squares
from evertwin.tuning.intervals.fit import Fit
from evertwin.tuning.intervals.identifiability import connected, gate
from evertwin.tuning.intervals.noisy_starts import without_noise
from evertwin.tuning.linear.closed import ClosedForm
from evertwin.tuning.linear.gram import FINE, solved
from evertwin.tuning.linear.sensitivity import Sensitivity
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.posing.settings import Settings
from evertwin.tuning.search.mixed import project, separable
from evertwin.tuning.search.nonlinear import begun, least_squares
from evertwin.types import Bool, Float64, Outputs, ParameterVector, PerOutput, Vector

LITTLE = 1.2
"""Times the squares that are left may grow where the noise of the starts is taken out."""


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
        DataError: an input is so large that the squares of what follows from it overflow.
    """
    began = time.perf_counter()
    if p0 is not None:
        problem = replace(
            problem, prior=(problem.prior or problem.model.parameters).with_values(p0)
        )
    # a simulation that runs away is infinite, not an accident: the fit says that it diverged
    with np.errstate(over="ignore", invalid="ignore"):
        if problem.linear and problem.loss == "linear":
            return _linear(problem, began)
        return _search(problem, settings or problem.settings, began)


def closed(
    problem: Problem, kept: Bool[np.ndarray, "n ny"] | None = None
) -> tuple[Vector, PerOutput, Float64[np.ndarray, "ny k k"]]:
    """A linear problem without its bounds: (values, noise, what each output tells of them).

    Args:
        kept: which values count, (n, ny); None: all.
    """
    start, (_, _, columns, at) = problem.start, problem.reduced
    first = problem.first if kept is None else np.where(kept, problem.first, np.nan)
    scale = np.full(len(at), np.nan) if problem.scale is None else problem.scale
    change, noise, blocks, code = solved(first, columns, at, problem.information, scale)
    if not np.isfinite(blocks).all():
        raise DataError(_beyond(problem))
    if code == FINE:
        return start + change, noise, blocks
    careful = ClosedForm(at, start, problem.information, scale).carefully(first, columns)
    return careful.values, careful.noise, blocks


def _linear(problem: Problem, began: float) -> Fit:
    values, noise, blocks = closed(problem)
    acting = Sensitivity(problem.reduced.columns, problem.reduced.at, problem.rows.used, blocks)
    _check_knobs(problem, acting)
    hit: tuple[str, ...] = ()
    ends = zip(values.tolist(), *(end.tolist() for end in problem.bounds), strict=True)
    if any(value < low or value > high for value, low, high in ends):
        values, hit = _bounded(problem, problem.first, noise)
    message = "solved" if not hit else f"solved; {', '.join(hit)} on a bound"
    return assemble(problem, Outcome(values, 1, 1, True, message, hit), acting, began)


def _beyond(problem: Problem) -> str:
    """What is beyond reckoning: the largest number among the inputs."""
    u = np.abs(problem.rows.u)
    row, column = np.unravel_index(int(np.nanargmax(u)), u.shape)
    channel = problem.model.inputs.channels[int(column)]
    return (
        f"{channel.name} is {u[row, column]:.3g} {channel.unit} in row {row} of the window, which "
        f"no machine reaches: leave the recording out, or give [signals.{channel.name}] low, high"
    )


def _bounded(problem: Problem, r: Outputs, sigma: PerOutput) -> tuple[Vector, tuple[str, ...]]:
    """Linear least squares inside the bounds, on the triangular factor of the rows."""
    used = problem.rows.used
    weight = 1.0 / np.where(sigma > 0, sigma, 1.0)
    a = (problem.jacobian(problem.start) * weight[:, None])[used]
    b = (r * weight)[used]
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
    _check_repeats(problem)
    begin = begun(problem, settings)
    acting = problem.sensitivity(begin)
    held = ("",) * len(problem.names)
    if acting.finite:
        _check_knobs(problem, acting)
        first = squares(problem, problem.residuals(begin))
        sigma = noise_of(problem, first, np.zeros(len(first.rows)))
        sizes = sizes_of(problem, acting, begin)
        before = gate(acting, sigma, problem.names, sizes)
        # Collinear parameters take part, so that the others stay unbiased; they are put back after.
        held = tuple(r if r.startswith("not excited") else "" for r in before.reasons)
    free = np.array([not reason for reason in held])
    if separable(problem) and problem.loss == "linear":
        outcome = project(problem, settings, free)
    else:
        outcome = least_squares(problem, settings, free)
    if not np.isfinite(problem.residuals(outcome.values)[problem.rows.used]).all():
        return _diverged(problem, outcome, began)
    left = squares(problem, problem.residuals(outcome.values))
    noise = noise_of(problem, left, acting.paid)
    freed = without_noise(problem, outcome.values, free, noise)
    there = squares(problem, problem.residuals(freed))
    one, two = (float(np.nansum(some.left / noise / noise)) for some in (left, there))
    if np.isfinite(there.left).all() and two <= LITTLE * one:  # else it led astray
        outcome = outcome._replace(values=freed)
    end = problem.sensitivity(outcome.values)
    return assemble(problem, outcome._replace(held=held), end, began)


def _check_repeats(problem: Problem) -> None:
    """A step in plain Python may draw numbers, or keep some from call to call.

    Raises:
        ModelError: the same rows are simulated otherwise the second time.
    """
    if problem.linear or is_native(problem.batch.kernel):
        return
    again = problem.rows.y - problem.predictions([problem.start])[0]
    again = np.abs(wrap(again, problem.model.outputs.angles) - problem.first)
    if (again > 0.0).any():
        row, k = np.unravel_index(int(np.nanargmax(again)), again.shape)
        output = problem.model.outputs.channels[int(k)]
        raise ModelError(
            "the model gives other outputs when the same rows are simulated again "
            f"({output.name} by {again[row, k]:.3g} {output.unit} at row {row}): its step draws "
            "random numbers, or keeps something between two calls; let it follow from x, u, dt "
            "and p alone"
        )


def _check_knobs(problem: Problem, acting: Sensitivity) -> None:
    """A parameter that moves nothing here is asked whether it acts anywhere.

    A number of a correction was learned from rows where it did: it only stays as it is.
    """
    told = np.logical_or.reduce(acting.acts, axis=0)
    if not told.all() and not problem.settings.lenient:
        model = problem.model
        own = (model.model if isinstance(model, Corrected) else model).parameters.names
        silent = tuple(problem.names[j] for j in np.flatnonzero(~told).tolist())
        connected(model, tuple(n for n in silent if n in own), problem.rows.u, problem.rows.dt)


def _diverged(problem: Problem, outcome: Outcome, began: float) -> Fit:
    """Nothing was learned: every value stays, every interval is infinite."""
    used = problem.rows.used
    nothing = Sensitivity.dense(np.zeros((*used.shape, len(problem.names))), used)
    held = ("the simulation diverged",) * len(problem.names)
    with np.errstate(over="ignore", invalid="ignore"):
        return assemble(problem, outcome._replace(held=held), nothing, began)
