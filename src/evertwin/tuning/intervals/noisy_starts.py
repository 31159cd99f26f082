"""Predictions begin where it was measured, so the noise of that measurement acts on every number.

A slow level that is taken too high seems to fall faster than it does: least squares finds a time
constant that is too short, the more so the shorter the predictions are, however many rows there
are. To second order in the noise, the sum of squares is too large by σ²‖S‖², with S the change of
the predictions with their starts; without that part it is least where the numbers are true (the
corrected score of T. Nakamura, Biometrika 77, 1990).

The noise is that of neighbouring residuals: the part of them that the next row takes back. What
the machine itself does at random, or does otherwise than the model, is none of it.

>>> level, noise = np.random.default_rng(1).standard_normal((2, 4000))
>>> seen = (0.1 * np.cumsum(level) + 0.5 * noise)[:, None]
>>> white(seen, np.ones(4000, dtype=bool)).round(1).tolist()
[0.5]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.tuning.intervals.identifiability import NULL
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Bools, Float64, Outputs, PerOutput, Vector

ROWS = 100
"""Rows that the noise of an output is told from, at least."""
ROUNDS = 3
"""Steps, each of which leaves of the error the share that the noise has of what the rows seem to
tell. To go on to the end would leave none on average, and now and then a number that is far off."""
NOTHING = 0.05
"""Step, in standard deviations, that is none."""
STEP = 100.0
"""Differences are taken over so many steps of `Problem.steps`: they are differences of a
difference."""


@dataclass(frozen=True)
class Noisy:
    """What noisy starts add to the score and to the information of the tuned parameters.

    >>> Noisy(np.ones(1), np.eye(1)).score.tolist()
    [1.0]
    """

    score: Vector
    """Σ S ∂S/∂p, weighed, (k,)."""
    information: Float64[np.ndarray, "k k"]
    """Σ ∂S/∂p ∂S/∂p, weighed: what the rows seem to tell and do not."""


def white(r: Outputs, follows: Bools) -> PerOutput:
    """Standard deviation of the white part of residuals (n, ny), (ny,); 0 where it is not told.

    Args:
        follows: is a row of the same prediction as the one before? (n,)
    """
    change = np.diff(r, axis=0)
    change[~follows[1:]] = np.nan
    turned = -change[1:] * change[:-1]  # a white row goes up and down again; −σ² on average
    known = np.isfinite(turned)
    count = known.sum(axis=0)
    total = np.where(known, turned, 0.0).sum(axis=0)
    mean = np.divide(total, count, out=np.zeros(len(count)), where=count >= ROWS)
    return np.asarray(np.sqrt(np.maximum(mean, 0.0)))


def noisy(problem: Problem, values: Vector, sigma: PerOutput) -> Noisy | None:
    """What the starts of a problem add at ``values``; None where they do nothing.

    Args:
        sigma: noise of each output's residual, (ny,).
    """
    if not len(problem.model.states) or problem.loss != "linear":
        return None
    follows = (problem.restart.code == 0) & problem.rows.used.any(axis=1)
    noise = white(problem.residuals(values), follows)
    if not noise.any() or problem.settings.quick:
        return None
    # both ends inside the bounds; where there is no room, the number does not move
    ends = [np.clip(values + sign * STEP * problem.steps(values), *problem.bounds)
            for sign in (-1.0, 1.0)]  # fmt: skip
    points = [values]
    for j in range(len(values)):
        for end in ends:
            points.append(values.copy())
            points[-1][j] = end[j]
    width = ends[1] - ends[0]
    score, information = np.zeros(len(values)), np.zeros((len(values), len(values)))
    for changes in problem.by_starts(points, noise):
        used = problem.rows.used & np.isfinite(changes[0])
        s = np.where(used, changes[0], 0.0) / sigma
        slope = np.stack([
            np.where(used, changes[2 + 2 * j] - changes[1 + 2 * j], 0.0) / sigma / width[j]
            if width[j] > 0 else np.zeros(used.shape)
            for j in range(len(values))
        ], axis=2)  # fmt: skip
        score += np.einsum("iok,io->k", slope, s)
        information += np.einsum("iok,iol->kl", slope, slope)
    return Noisy(score, information) if np.isfinite(score).all() else None


def without_noise(problem: Problem, values: Vector, free: Bools, sigma: PerOutput) -> Vector:
    """Where the sum of squares without the part of the starts is least, from ``values`` (k,) on.

    Args:
        free: parameters that were searched for, (k,).
        sigma: noise of each output's residual, (ny,).
    """
    (low, high), before = problem.bounds, values
    for _ in range(ROUNDS):
        adds = noisy(problem, values, sigma)
        if adds is None:
            break
        used = problem.rows.used
        j = np.where(used[:, :, None], problem.jacobian(values), 0.0) / sigma[:, None]
        r = np.where(used, problem.residuals(values), 0.0) / sigma
        score = np.einsum("iok,io->k", j, r) + adds.score
        score -= problem.information * (values - problem.start)
        whole = np.einsum("iok,iol->kl", j, j) + np.diag(problem.information)
        if not (np.isfinite(whole).all() and np.isfinite(score).all()):
            return before  # the step led to where the model diverges
        basis = _told(whole, free & (values > low) & (values < high))
        step = basis @ (basis.T @ score)
        before, values = values, np.clip(values + step, low, high)
        if step @ whole @ step < NOTHING**2:
            break
    return values


def widened_by(
    problem: Problem, values: Vector, whole: Float64[np.ndarray, "k k"], sigma: PerOutput
) -> Float64[np.ndarray, "k k"] | None:
    """What an error of the score does to the numbers, in what it does without noise at the starts;
    None where that is the same.

    Args:
        whole: information of the rows and the prior, (k, k).
    """
    adds = noisy(problem, values, sigma)
    if adds is None:
        return None
    basis = _told(whole, np.ones(len(values), dtype=np.bool_))
    share, turn = np.linalg.eigh(basis.T @ adds.information @ basis)
    more = sum(np.minimum(share, 1.0) ** k for k in range(1, ROUNDS + 1))
    return np.asarray(np.eye(len(values)) + basis @ (turn * more) @ turn.T @ basis.T @ whole)


def _told(whole: Float64[np.ndarray, "k k"], free: Bools) -> Float64[np.ndarray, "k m"]:
    """Directions of the ``free`` numbers that the rows tell, a standard deviation each."""
    length = np.sqrt(np.where(free, whole.diagonal(), 0.0))
    inverse = np.divide(1.0, length, out=np.zeros(len(length)), where=length > 0)
    squares, vectors = np.linalg.eigh(whole * np.outer(inverse, inverse))
    told = squares > NULL**2
    return np.asarray(inverse[:, None] * vectors[:, told] / np.sqrt(squares[told]))
