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
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.tuning.advice import advise
from evertwin.tuning.fit import Fit, Residual
from evertwin.tuning.identifiability import Gate, gate, grade
from evertwin.tuning.problem import PerOutput, Problem
from evertwin.tuning.statistics import dependences, effective, ljung_box, spread
from evertwin.types import Float64, Outputs, Vector

__all__ = ["Outcome", "assemble", "judge", "rms"]

Sensitivity = Float64[np.ndarray, "n ny k"]


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


def rms(values: Outputs) -> PerOutput:
    """Root mean square per column over what is not NaN; NaN for an empty column.

    >>> rms(np.array([[3.0], [np.nan], [4.0]])).round(3).tolist()
    [3.536]
    """
    known = ~np.isnan(values)
    with np.errstate(over="ignore"):  # of a diverged simulation it is infinite
        total = np.square(np.where(known, values, 0.0)).sum(axis=0)
    count = known.sum(axis=0)
    mean = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    return np.asarray(np.sqrt(mean))


def noise_of(problem: Problem, r: Outputs, parameters: PerOutput) -> PerOutput:
    """Standard deviation of each output's residual: given, or from its degrees of freedom.

    Args:
        parameters: number of parameters that each output pays for, (ny,).
    """
    if problem.scale is not None:
        return problem.scale
    known = ~np.isnan(r)
    count = known.sum(axis=0)
    if problem.loss == "linear":
        total = np.square(np.where(known, r, 0.0)).sum(axis=0)
        sigma = np.sqrt(total / np.maximum(count - parameters, 1.0))
    else:
        sigma = np.array([1.4826 * np.median(np.abs(c[k])) for c, k in zip(r.T, known.T)])
    # Exact data: below the rounding of the measurement nothing is known about the noise.
    floor = 1e-12 * np.nan_to_num(rms(problem.rows.y)) + 1e-300
    return np.asarray(np.maximum(np.nan_to_num(sigma), floor))


def judge(problem: Problem, j: Sensitivity, sigma: PerOutput, values: Vector) -> Gate:
    """The identifiability gate on the rows that count."""
    scaled = np.where(problem.rows.used[:, :, None], j, 0.0) / sigma[:, None]
    flat = np.ascontiguousarray(scaled.reshape(-1, scaled.shape[2]))
    sizes = sizes_of(problem, j, sigma, values)
    count = problem.rows.used.sum() - len(sizes)
    dof = np.inf if problem.scale is not None else float(max(count, 1))
    shape = problem.rows.used.shape
    return gate(flat.T @ flat, lambda d: (flat @ d).reshape(shape), problem.names, sizes, dof)


def sizes_of(problem: Problem, j: Sensitivity, sigma: PerOutput, values: Vector) -> Vector:
    """Natural size of each parameter, (k,): what counts as a large error of it."""
    sizes = np.maximum(np.abs(problem.start), np.abs(values))
    # A parameter that starts at zero may well end near it and has no size of its own there: a
    # tenth of what would explain the whole output.
    length = np.sqrt(np.square(np.where(problem.rows.used[:, :, None], j, 0.0) / sigma[:, None])
                     .sum(axis=(0, 1)))  # fmt: skip
    whole = np.sqrt(np.nansum(np.square(problem.rows.y / sigma)))
    tenth = np.divide(0.1 * whole, length, out=np.ones(len(sizes)), where=length > 0)
    zero = problem.start == 0
    sizes[zero] = np.maximum(sizes[zero], tenth[zero])
    sizes[sizes == 0] = 1.0
    return np.asarray(sizes)


def assemble(
    problem: Problem, outcome: Outcome, start: Vector, j: Sensitivity, began: float
) -> Fit:
    """The Fit of an outcome.

    Args:
        j: sensitivity at the outcome, (n, ny, k).
        began: `time.perf_counter` at the start.
    """
    before, r = problem.residuals(start), problem.residuals(outcome.values)
    paid = np.count_nonzero(
        np.abs(np.where(problem.rows.used[:, :, None], j, 0)).sum(axis=0), axis=1
    )
    sigma = noise_of(problem, r, paid.astype(np.float64))
    judged = judge(problem, j, sigma, outcome.values)
    refused = _refused(judged, outcome.held)
    if any(outcome.held):
        j = np.where([bool(reason) for reason in outcome.held], 0.0, j)
    covariance, quantile = _covariance(problem, j, r, sigma)
    half = quantile * np.sqrt(np.diag(covariance))
    verdicts, reasons = grade(refused, half / sizes_of(problem, j, sigma, outcome.values))
    verdicts, reasons = _doubted(problem, outcome.values, verdicts, reasons)
    free = np.array([verdict != "not" for verdict in verdicts])
    values = np.where(free, outcome.values, start)
    wide = ~free & np.array([not reason for reason in refused])
    if wide.any():
        values = _followed(problem, j, sigma, values, free)
    if not np.array_equal(values, outcome.values):
        r = problem.residuals(values)
    covariance[~free, :], covariance[:, ~free] = 0.0, 0.0
    covariance[~free, ~free] = np.inf
    half[~free] = np.inf
    y = problem.rows.y
    rows_moving = _moving(problem)
    return Fit(
        names=problem.names,
        units=tuple(problem.parameters[name].unit for name in problem.names),
        values=values,
        start=start,
        sigma=np.sqrt(np.diag(covariance)),
        interval95=np.stack([values - half, values + half], axis=1),
        covariance=covariance,
        verdict=verdicts,
        reasons=_reasons(problem, reasons, outcome.at_bound),
        p=problem.full(values),
        cost=0.5 * float(np.nansum(np.square(r / sigma))),
        outputs=problem.model.outputs.names,
        deviation_before=_ratio(before, y),
        deviation_after=_ratio(r, y),
        moving_before=_ratio(
            np.where(rows_moving, before, np.nan), np.where(rows_moving, y, np.nan)
        ),
        moving_after=_ratio(np.where(rows_moving, r, np.nan), np.where(rows_moving, y, np.nan)),
        noise=sigma,
        residuals=_residuals(problem, before, r),
        condition=judged.condition,
        at_bound=outcome.at_bound,
        iterations=outcome.iterations,
        evaluations=outcome.evaluations,
        method=outcome.method,
        converged=outcome.converged,
        message=outcome.message,
        seconds=time.perf_counter() - began,
    )


def _doubted(
    problem: Problem, values: Vector, verdicts: tuple[str, ...], reasons: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What resists by its nature and was fitted below zero is not called identifiable."""
    told = list(zip(verdicts, reasons, strict=True))
    for k, name in enumerate(problem.names):
        if problem.parameters[name].resists and values[k] < 0 and told[k][0] == "identifiable":
            told[k] = ("weak", "negative, so it would drive: the rows or the form mislead it")
    return tuple(verdict for verdict, _ in told), tuple(reason for _, reason in told)


def _followed(
    problem: Problem, j: Sensitivity, sigma: PerOutput, values: Vector, free: np.ndarray
) -> Vector:
    """Values whose free ones make up for those with too wide an interval, which went back.

    Parameters that are only *nearly* collinear with the free ones carry part of the solution:
    putting them back alone would predict worse than the start. (What is exactly collinear is
    left alone: there the free ones are right as they are.) To first order, exact if linear.
    """
    scaled = np.where(problem.rows.used[:, :, None], j, 0.0) / sigma[:, None]
    flat = scaled.reshape(-1, len(values))
    r = problem.residuals(values) / sigma
    information = flat[:, free].T @ flat[:, free] + np.diag(problem.information[free])
    pull = (problem.start - values) * problem.information
    side = flat[:, free].T @ np.nan_to_num(r.ravel()) + pull[free]
    out = values.copy()
    size = np.sqrt(np.diag(information))
    size[size == 0] = 1.0
    unit = information / np.outer(size, size)
    out[free] += np.linalg.lstsq(unit, side / size, rcond=1e-12)[0] / size
    low, high = problem.bounds
    return np.asarray(np.clip(out, low, high))


def _refused(judged: Gate, held: tuple[str, ...]) -> list[str]:
    """Why each parameter may not be tuned: held before solving, or refused by a direction."""
    before = held or ("",) * len(judged.reasons)
    rows = zip(before, judged.reasons, judged.undetermined, strict=True)
    return [was or (reason if bad else "") for was, reason, bad in rows]


def _ratio(r: Outputs, y: Outputs) -> tuple[float, ...]:
    with np.errstate(divide="ignore", invalid="ignore"):
        return tuple((rms(r) / rms(np.where(np.isnan(r), np.nan, y))).tolist())


def _moving(problem: Problem) -> np.ndarray:
    if problem.moving is None:
        return problem.rows.used
    return np.asarray(np.asarray(problem.moving(problem.rows.u)) & problem.rows.used)


def _reasons(
    problem: Problem, reasons: tuple[str, ...], at_bound: tuple[str, ...]
) -> tuple[str, ...]:
    """Why each parameter is weak or not identifiable, and what would help."""
    names, out = problem.names, []
    cures: dict[str, str] = {}
    for name, reason in zip(names, reasons, strict=True):
        parts = [reason, "ended on its bound" if name in at_bound else ""]
        if "collinear" in reason or "not excited" in reason:
            if reason not in cures:
                same = [n for n, r in zip(names, reasons, strict=True) if r == reason]
                cures[reason] = _cure(problem, same)
            parts.append(cures[reason])
        out.append("; ".join(filter(None, parts)))
    return tuple(out)


def _cure(problem: Problem, names: list[str]) -> str:
    needs = advise(problem.model, names, problem.rows.u)
    if needs:
        return f"needs {' and '.join(needs)}"
    return f"no motion tells them apart: fix one of {', '.join(names)}" if len(names) > 1 else ""


def _covariance(
    problem: Problem, j: Sensitivity, r: Outputs, sigma: PerOutput
) -> tuple[Float64[np.ndarray, "k k"], Vector]:
    """Covariance and Student's quantile per parameter, with the residual's own autocorrelation."""
    used = problem.rows.used
    k = j.shape[2]
    scaled = np.where(used[:, :, None], j, 0.0) / sigma[:, None]
    flat = scaled.reshape(-1, k)
    prior = np.diag(problem.information)
    inverse = _pinv(flat.T @ flat + prior)
    known = np.diag(inverse @ prior @ inverse)
    parts = np.zeros((len(sigma), k))
    dof = np.zeros(len(sigma))
    for o in range(len(sigma)):
        column = np.where(used[:, o], r[:, o], np.nan)
        acting = np.flatnonzero(np.any(scaled[:, o] != 0, axis=0))
        if not len(acting):
            continue
        influence = scaled[:, o, acting] @ inverse[acting]
        parts[o] = spread(influence, column)
        dof[o] = max(effective(column) - len(acting), 1.0)
    variance = parts.sum(axis=0) + known
    if problem.scale is not None:
        dof[:] = np.inf
    with np.errstate(divide="ignore", invalid="ignore"):
        weighted = np.square(parts) / np.where(dof > 0, dof, np.inf)[:, None]
        degrees = np.square(variance) / weighted.sum(axis=0)
        factor = np.sqrt(variance / np.diag(inverse))
    factor = np.where(np.isfinite(factor), factor, 1.0)
    covariance = inverse * np.outer(factor, factor)
    degrees = np.where(np.isnan(degrees), np.inf, np.maximum(degrees, 1.0))
    return covariance, np.asarray(scipy.special.stdtrit(degrees, 0.975))


def _pinv(h: Float64[np.ndarray, "k k"]) -> Float64[np.ndarray, "k k"]:
    """Inverse in the space that the rows and the prior determine."""
    d = np.sqrt(np.diag(h))
    d[d == 0] = np.inf
    scaled = h / np.outer(d, d)
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-6, hermitian=True) / np.outer(d, d))


def _residuals(problem: Problem, before: Outputs, r: Outputs) -> tuple[Residual, ...]:
    names = problem.model.outputs.names
    found = {d.output: d for d in dependences(r, problem.rows.u, names, problem.model.inputs.names)}
    first, last = rms(before), rms(r)
    return tuple(
        Residual(
            name, int(problem.rows.used[:, k].sum()), float(first[k]), float(last[k]),
            ljung_box(r[:, k]), found.get(name),
        )
        for k, name in enumerate(names)
    )  # fmt: skip
