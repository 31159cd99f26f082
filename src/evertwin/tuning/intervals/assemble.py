"""From tuned values to a `Fit`: intervals, verdicts, deviations and residual statistics.

Intervals follow from the sensitivity J and the residual itself. With C the inverse of the
information (prior included) each row pulls the estimates by c_t = C Jₜᵀ/σ², so that the variance
is Σ c_t c_s γ(t − s) with the residual's own autocovariance γ: for white noise this is C itself,
for filtered or coloured residuals it is larger. Degrees of freedom count effective rows
(Satterthwaite over outputs), and the quantile is Student's.

>>> Outcome(np.ones(1), 3, 7, True, "done").at_bound
()
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.models.kernels.kernel import ANEW
from evertwin.signals.sizes import sizes
from evertwin.tuning.intervals.adopted_noise import by_noise
from evertwin.tuning.intervals.advice import advise
from evertwin.tuning.intervals.doubted import beyond, doubted, misled, on_bounds, strays
from evertwin.tuning.intervals.fit import Fit, Residual
from evertwin.tuning.intervals.identifiability import gate, grade
from evertwin.tuning.intervals.noisy_starts import widened_by
from evertwin.tuning.intervals.valleys import bends, valley
from evertwin.tuning.linear.closed import dense, summed
from evertwin.tuning.linear.gram import combined
from evertwin.tuning.linear.sensitivity import Sensitivity, Spectrum
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.residuals.autocorrelation import Correlation, effective
from evertwin.tuning.residuals.statistics import depends, spread, whiteness
from evertwin.tuning.residuals.statistics_loop import LONG, propagated, tally
from evertwin.types import Bools, Float64, Outputs, PerOutput, Vector


class Outcome(NamedTuple):
    """What a solver found.

    >>> Outcome._fields[0]
    'values'
    """

    values: Vector
    iterations: int
    evaluations: int
    converged: bool
    message: str
    at_bound: tuple[str, ...] = ()
    method: str = "closed form"
    held: tuple[str, ...] = ()
    """Why a parameter was held, per parameter; empty text where it was tuned."""


ROUNDED = 1e6
"""Times the least that one of a unit may be to explain its output, at most, that another is."""
LEAST = 1e-150
"""Noise of what no row tells: its square still is a number."""
ALIKE = 1.01
"""Times what a search leaves that the same may leave with what it did not tell put back."""


class Squares(NamedTuple):
    """Sums of squares per output over the rows that count and are predicted, (ny,) each.

    >>> Squares._fields[:3]
    ('rows', 'measured', 'left')
    """

    rows: PerOutput
    measured: PerOutput
    left: PerOutput
    """Of the residual."""
    rms: tuple[float, ...]
    """Of the residual; NaN without rows."""
    relative: tuple[float, ...]
    """rms of the residual over that of the measurement."""
    relative_moving: tuple[float, ...]
    """The same over moving rows."""
    counted: tuple[int, ...]
    """Rows that count, predicted or not."""
    r: Outputs
    """The residual itself."""


def squares(problem: Problem, r: Outputs) -> Squares:
    """Of a residual (n, ny)."""
    found, roots = tally(problem.rows.y, r, problem.rows.moving)
    warm = problem.model.outputs.temperatures
    if warm.any():
        y = np.where(np.isnan(r), np.nan, problem.rows.y)
        with np.errstate(divide="ignore", invalid="ignore"):
            roots[1:, warm] = roots[0, warm] / sizes(y, warm)[warm]
    rms, relative, moving = (tuple(row) for row in roots.tolist())
    rows, measured, left, *_, counted = found
    return Squares(rows, measured, left, rms, relative, moving, tuple(map(int, counted)), r)


def noise_of(problem: Problem, left: Squares, parameters: PerOutput) -> PerOutput:
    """Standard deviation of each output's residual: given, or from its degrees of freedom.

    Args:
        parameters: number of parameters that each output pays for, (ny,).
    """
    if problem.scale is not None:
        return problem.scale
    if problem.loss == "linear":
        sigma = np.sqrt(left.left / np.maximum(left.rows - parameters, 1.0))
    else:
        sizes = [np.abs(column[~np.isnan(column)]) for column in left.r.T]
        sigma = np.array([1.4826 * np.median(size) if len(size) else 0.0 for size in sizes])
    # Exact data: below the rounding of the measurement nothing is known about the noise.
    measured = np.sqrt(left.measured / np.maximum(left.rows, 1.0))
    return np.asarray(np.maximum(sigma, 1e-12 * measured + LEAST))


def sizes_of(problem: Problem, acting: Sensitivity, values: Vector) -> Vector:
    """Natural size of each parameter, (k,): what counts as a large error of it."""
    sizes = np.maximum(np.abs(problem.start), np.abs(values))
    zero = problem.start == 0
    if zero.any():
        # A parameter that starts at zero may well end near it and has no size of its own there: a
        # tenth of what would explain the whole of the output that it explains best.
        whole = np.nansum(np.square(problem.rows.y), axis=0)[:, None]
        square = np.divide(whole, acting.squares, out=np.full_like(acting.squares, np.inf),
                           where=acting.acts)  # fmt: skip
        tenth = 0.1 * np.sqrt(square.min(axis=0))
        known = zero & np.isfinite(tenth)
        sizes[known] = np.maximum(sizes[known], tenth[known])
        # what needs far more than others of its unit do is moved by rounding alone
        unit = np.array([problem.parameters.items[place].unit for place in problem.places.tolist()])
        for one in np.unique(unit[known]):
            mine = known & (unit == one)
            sizes[mine] = np.minimum(sizes[mine], ROUNDED * tenth[mine].min())
    # far outside of what is known of it a value tells no size: the rows lead it astray
    sizes = np.maximum(np.abs(problem.start), np.minimum(sizes, problem.sigma))
    sizes[sizes == 0] = 1.0
    return np.asarray(sizes)


def assemble(problem: Problem, outcome: Outcome, acting: Sensitivity, began: float) -> Fit:
    """The Fit of an outcome.

    Args:
        acting: sensitivity at the outcome.
        began: `time.perf_counter` at the start.
    """
    start, held, values = problem.start, outcome.held, outcome.values
    before = squares(problem, problem.first)
    left = squares(problem, problem.residuals(outcome.values))
    sigma = noise_of(problem, left, acting.paid)
    sizes = sizes_of(problem, acting, outcome.values)
    stateful = len(problem.model.states) > 0
    judged = gate(acting, sigma, problem.names, sizes, left.r if stateful else None)
    refused = [was or now for was, now in zip(held or judged.reasons, judged.reasons, strict=True)]
    if any(held):
        acting = acting.without(np.array([bool(reason) for reason in held]))
    spectrum = judged.spectrum
    if any(held) or len(spectrum.squares) < len(sizes) or problem.information.any():
        spectrum = Spectrum.of(acting.information(sigma) + np.diag(problem.information))
    correlation = Correlation.of(left.r)
    covariance, quantile, edge = _covariance(
        problem, outcome.values, acting, correlation, (sigma, spectrum)
    )
    half = quantile * np.sqrt(covariance.diagonal())
    astray = strays(problem.model, left.relative)
    told = half, grade(refused, half / sizes)
    verdicts, reasons, bounds, few = _verdicts(problem, outcome, acting, (left, astray), told)
    half[few], covariance[few, few] = np.inf, np.inf
    if "not" in verdicts:
        free = np.array([verdict != "not" for verdict in verdicts])
        wide = ~free & np.array([not reason for reason in refused])
        values, left = _put_back(problem, acting, sigma, (values, left), (free, wide))
        correlation = Correlation.of(left.r)
        covariance[~free, :], covariance[:, ~free] = 0.0, 0.0
        covariance[~free, ~free] = np.inf
        half[~free] = np.inf
    said = valley(problem.names, verdicts, values != start) if stateful else ""
    items = [problem.parameters.items[place] for place in problem.places.tolist()]
    return Fit(
        names=problem.names,
        units=tuple(item.unit for item in items),
        values=values,
        start=start,
        sigma=np.sqrt(covariance.diagonal()),
        interval95=np.array([values - half, values + half]).T,
        covariance=covariance,
        verdict=verdicts,
        reasons=_reasons(problem, reasons, bounds),
        p=problem.full(values)[: len(problem.model.parameters)],
        cost=0.5 * float((left.left / sigma / sigma).sum()),
        outputs=problem.model.outputs.names,
        deviation_before=before.relative,
        deviation_after=left.relative,
        moving_before=before.relative_moving,
        moving_after=left.relative_moving,
        noise=sigma,
        residuals=_residuals(problem, before, left, correlation),
        condition=judged.condition,
        at_bound=outcome.at_bound,
        iterations=outcome.iterations,
        evaluations=outcome.evaluations,
        method=outcome.method,
        converged=outcome.converged,
        message=outcome.message + said + edge + (f"; {astray}" if astray else ""),
        seconds=time.perf_counter() - began,
    )


def _verdicts(
    problem: Problem, outcome: Outcome, acting: Sensitivity, found: tuple[Squares, str],
    told: tuple[Vector, tuple[Sequence[str], Sequence[str]]],
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...], Bools]:  # fmt: skip
    """(verdicts, why, what is said of those on a bound, whose noise no value is left to tell).

    Args:
        found: what is left, and why the model goes astray, if it does.
        told: half widths of the intervals, (k,), and what these say by themselves.
    """
    values, (left, astray), (half, graded) = outcome.values, found, told
    why = misled(problem, values, acting, left.rows, astray)
    verdicts, reasons = doubted(problem, values, half, graded, why)
    verdicts, bounds = on_bounds(problem, values, outcome.at_bound, verdicts)
    return verdicts, reasons, bounds, beyond(problem, acting, left.rows) < 1.0


def _put_back(
    problem: Problem, acting: Sensitivity, sigma: PerOutput, found: tuple[Vector, Squares],
    which: tuple[np.ndarray, np.ndarray],
) -> tuple[Vector, Squares]:  # fmt: skip
    """Values and their residual with all at its start that is not ``which`` (free, wide).

    The valley of a model with a state is curved, so that what is free does not make up for that in
    one step: where it would explain less, all stays as the search found it.
    """
    (values, left), (free, wide) = found, which
    back = np.where(free, values, problem.start)
    if wide.any():
        back = _followed(problem, acting, sigma, back, free)
    there = squares(problem, problem.residuals(back))
    if not len(problem.model.states):
        return back, there
    before = squares(problem, problem.first)
    one, two, first = (float(np.nansum(r.left / sigma / sigma)) for r in (there, left, before))
    # what runs away is predicted on fewer rows
    alike = tuple(there.rows) == there.counted and one <= min(ALIKE**2 * two, first)
    return (back, there) if alike else found


def _followed(
    problem: Problem, acting: Sensitivity, sigma: PerOutput, values: Vector, free: np.ndarray
) -> Vector:
    """Values whose free ones make up for those with too wide an interval, which went back.

    Parameters that are only *nearly* collinear with the free ones carry part of the solution:
    putting them back alone would predict worse than the start. (What is exactly collinear is
    left alone: there the free ones are right as they are.) To first order, exact if linear.
    """
    sides = summed(problem.residuals(values), acting.columns).sides
    sides /= np.square(sigma)[:, None]
    side = (problem.start - values) * problem.information
    on = acting.at >= 0
    np.add.at(side, acting.at[on], sides[on])
    information = (acting.information(sigma) + np.diag(problem.information))[np.ix_(free, free)]
    out, bounds = values.copy(), problem.bounds
    change = _within(information, side[free], *(end[free] - values[free] for end in bounds))
    out[free] += change
    return np.asarray(np.clip(out, *bounds))


def _within(
    information: Float64[np.ndarray, "k k"], side: Vector, low: Vector, high: Vector
) -> Vector:
    """The solution of a normal system inside bounds: what would leave them stays on them."""
    size = np.sqrt(np.diag(information))
    size[size == 0] = 1.0
    unit, change, inside = information / np.outer(size, size), np.zeros(len(side)), size > 0
    for _ in side:
        left = (side - information @ np.where(inside, 0.0, change))[inside] / size[inside]
        found = np.linalg.lstsq(unit[np.ix_(inside, inside)], left, rcond=1e-12)[0]
        change[inside] = found / size[inside]
        out = inside & ((change < low) | (change > high))
        change = np.clip(change, low, high)
        if not out.any():
            break
        inside &= ~out
    return change


def _reasons(
    problem: Problem, reasons: tuple[str, ...], bounds: tuple[str, ...]
) -> tuple[str, ...]:
    """Why each parameter is weak or not identifiable, and what would help."""
    if not (any(reasons) or any(bounds)):
        return reasons
    names, out = problem.names, []
    cures: dict[str, str] = {}
    for reason, bound in zip(reasons, bounds, strict=True):
        parts = [reason, bound]
        if ("collinear" in reason or "not excited" in reason) and not problem.settings.quick:
            if reason not in cures:
                same = [n for n, r in zip(names, reasons, strict=True) if r == reason]
                cures[reason] = _cure(problem, same)
            parts.append(cures[reason])
        out.append("; ".join(filter(None, parts)))
    return tuple(out)


def _cure(problem: Problem, names: list[str]) -> str:
    own = [name for name in names if name in problem.model.parameters.names]
    needs = advise(problem.model, own, problem.rows.u, problem.rows.dt) if own else ()
    if needs:
        return f"needs {' and '.join(needs)}"
    return f"no motion tells them apart: fix one of {', '.join(names)}" if len(names) > 1 else ""


def _covariance(
    problem: Problem, values: Vector, acting: Sensitivity, correlation: Correlation,
    told: tuple[PerOutput, Spectrum],
) -> tuple[Float64[np.ndarray, "k k"], Vector, str]:  # fmt: skip
    """Covariance and Student's quantile per parameter, with the residual's own autocorrelation,
    and where beside the values the simulation diverges.

    Args:
        told: noise of each output, and the information with the prior's.
    """
    sigma, spectrum = told
    # a valley of a model with a state is as wide as its prior: it is counted, not left out
    least = 1e-13 if len(problem.model.states) else 1e-6
    act = acting.columns, acting.at, acting.used, acting.blocks
    inverse, parts, rows = propagated(tuple(spectrum), least, sigma, act, correlation.parts)
    for o, reach in enumerate(correlation.reach.tolist()):
        if reach == LONG:
            (columns, mine), rho = acting.of(o), correlation.memory[o]
            more = spread(columns, acting.used[:, o], inverse[mine] / sigma[o], rho)
            parts[o] += np.maximum(more, 0.0)
            rows[o] = effective(rows[o], rho)
    if problem.scale is not None:
        rows[:] = np.inf
    edge = ""
    covariance, degrees = combined(parts, inverse, problem.information, rows, acting.paid)
    if len(problem.model.states):
        covariance += _by_starts(problem, values, acting, sigma, inverse)
        known, own = by_noise(problem, values, acting, sigma, inverse), covariance.diagonal()
        ratio = np.sqrt(np.maximum(known / np.where(own > 0.0, own, np.inf), 1.0))
        covariance *= np.outer(ratio, ratio)
        bent, edge = bends(problem, values, acting, sigma)
        covariance += np.diag(np.square(bent))
        whole = acting.information(sigma) + np.diag(problem.information)
        wider = widened_by(problem, values, whole, sigma)
        covariance = covariance if wider is None else wider @ covariance @ wider.T
    return covariance, student(degrees), edge


def _by_starts(
    problem: Problem, values: Vector, acting: Sensitivity, sigma: PerOutput,
    inverse: Float64[np.ndarray, "k k"],
) -> Float64[np.ndarray, "k k"]:  # fmt: skip
    """What the noise of the measured starts adds: all that a start leads to errs by one number."""
    columns = dense(acting.columns, acting.at, len(values))
    columns = np.where(acting.used[:, :, None], columns, 0.0)
    opens = np.flatnonzero(problem.restart.code == ANEW)
    added = np.zeros_like(inverse)
    for (change,) in problem.by_starts([values], sigma, anew=True):
        pull = np.where(acting.used, change, 0.0) / sigma / sigma  # the square of a tiny one is 0
        sides = np.add.reduceat(np.einsum("iok,io->ik", columns, pull), opens, axis=0)
        added += (sides @ inverse).T @ (sides @ inverse)
    return added


def student(degrees: Vector) -> Vector:
    """97.5 % quantile of Student's distribution; normal at infinite degrees of freedom.

    >>> student(np.array([1.0, np.inf])).round(2).tolist()
    [12.71, 1.96]
    """
    return np.where(np.isinf(degrees), 1.959963984540054, scipy.special.stdtrit(degrees, 0.975))


def _residuals(
    problem: Problem, before: Squares, left: Squares, correlation: Correlation
) -> tuple[Residual, ...]:
    names, inputs = problem.model.outputs.names, problem.model.inputs.names
    found = {d.output: d for d in depends(correlation, problem.rows.classes, names, inputs)}
    rms = zip(before.rms, left.rms, whiteness(correlation).tolist(), strict=True)
    return tuple(
        Residual(name, left.counted[k], first, last, white, found.get(name))
        for k, (name, (first, last, white)) in enumerate(zip(names, rms, strict=True))
    )
