"""What is left of a prediction, along what an input does to it.

The outputs of a robot are east and north; what it loses of its speed lies along its way, wherever
that leads. Such a residual depends on no input output by output, and along the effect of the speed
on all of them it does.

A command that acts at any time between two rows is in one of them as if it had acted all the while.
What that leaves follows each change of the command, whatever the form.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.signals import wrap
from evertwin.tuning import Problem
from evertwin.types import Bools, Float64, Outputs, Vector

STEP = 1e-3
"""Share of an input by which its effect is told."""


def effects(problem: Problem, values: Vector) -> list[Outputs]:
    """What each input, as it is, does to the predictions, (n, ny) each: u·∂y/∂u."""
    model, found = problem.model, list[Outputs]()
    r = problem.residuals(values)
    for j in range(len(model.inputs)):
        windows = []
        for window in problem.windows:
            u = window.u.copy()
            u[:, j] *= 1.0 + STEP
            windows.append(window._replace(u=u))
        moved = replace(problem, windows=tuple(windows)).residuals(values)
        found.append(wrap(r - moved, model.outputs.angles) / STEP)
    return found


def timed(
    problem: Problem, values: Vector, noise: Float64[np.ndarray, " ny"]
) -> tuple[Outputs, Float64[np.ndarray, " nu"]]:
    """The residuals less what each input leaves that acts up to a row sooner or later, (n, ny); and
    by how many rows sooner, (nu,)."""
    r, angles = problem.residuals(values), problem.model.outputs.angles
    unit, moved = np.where(noise > 0, noise, 1.0), list[Outputs]()
    for j in range(len(problem.model.inputs)):
        windows = []
        for window in problem.windows:
            u = window.u.copy()
            u[:-1, j] = u[1:, j]
            windows.append(window._replace(u=u))
        sooner = replace(problem, windows=tuple(windows)).residuals(values)
        moved.append(wrap(r - sooner, angles))
    effect = np.stack(moved, axis=-1)
    known = np.isfinite(r) & np.isfinite(effect).all(axis=-1)
    columns, off = (effect / unit[:, None])[known], (r / unit)[known]
    if not known.any():
        return r, np.zeros(len(moved))
    rows = np.linalg.lstsq(columns, off, rcond=None)[0]
    rows = np.where(np.abs(rows) < 1.0, rows, 0.0)  # more of them are a delay or a lag
    return r - np.where(np.isfinite(effect), effect, 0.0) @ rows, rows


def late(left: Outputs, predicted: Outputs, follows: Bools) -> Outputs:
    """What a static map leaves, less what a shift of up to a row leaves of its predictions: what a
    derivative is of lies between two rows, what it is compared with is held from one to the next.

    >>> t = np.arange(200.0)[:, None]
    >>> y, seen = np.sin(0.1 * t), np.sin(0.1 * (t - 0.4))
    >>> left = late(seen - y, y, np.ones(200, dtype=bool))
    >>> bool(left.std() < 0.2 * (seen - y).std())
    True

    Args:
        follows: is a row the next of the one before? (n,)
    """
    found = left.copy()
    step = np.diff(predicted, axis=0, prepend=predicted[:1])
    step[~follows] = np.nan
    for k in range(left.shape[1]):
        known = np.isfinite(left[:, k]) & np.isfinite(step[:, k])
        size = float(step[known, k] @ step[known, k])
        rows = float(step[known, k] @ left[known, k]) / size if size > 0.0 else 0.0
        if abs(rows) < 1.0:  # more of them are a delay or a lag
            found[known, k] -= rows * step[known, k]
    return found


def along(
    effect: Outputs, residuals: Outputs, noise: Float64[np.ndarray, " ny"]
) -> Float64[np.ndarray, " n"]:
    """The residuals along an effect, in units of the noise, (n,); NaN where it has none.

    >>> east = np.array([[2.0, 0.0], [0.0, 1.0]])
    >>> along(east, np.array([[0.3, 5.0], [5.0, -0.3]]), np.ones(2)).tolist()
    [0.3, -0.3]
    """
    unit = np.where(noise > 0, noise, 1.0)
    way, off = effect / unit, residuals / unit
    known = np.isfinite(off) & np.isfinite(way)
    size = np.sqrt(np.where(known, way**2, 0.0).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        told = np.where(known, off * way, 0.0).sum(axis=1) / size
    return np.where(size > 0, told, np.nan)
