"""What is left of a prediction, along what an input does to it.

The outputs of a robot are east and north; what it loses of its speed lies along its way, wherever
that leads. Such a residual depends on no input output by output, and along the effect of the speed
on all of them it does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.signals import wrap
from evertwin.tuning import Problem
from evertwin.types import Float64, Outputs, Vector

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
