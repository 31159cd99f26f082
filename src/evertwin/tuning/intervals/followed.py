"""How much of what an output does a model does not follow, beside the noise of its measurements.

A residual whose neighbours differ by √2 of its size is noise. Where they are alike, something is
left that the model does not do, but for what the noise of a measured start does to all the rows
that begin with it. The measure is the simplest description: an output that stays where its
prediction began, or at its mean.

>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> rows = make_block(
...     t=np.arange(50) * 10**8, u=np.ones((50, 1)), y=0.09 * np.arange(50.0)[:, None])
>>> problem = Problem(Robot1D(), (rows,), ("gain",))
>>> missed(problem, np.array([1.0])).round(2).tolist()
[0.23]
"""

from __future__ import annotations

import numpy as np

from evertwin.models.kernels.kernel import ANEW
from evertwin.signals import wrap
from evertwin.signals.sizes import mean_square
from evertwin.tuning.intervals.noisy_starts import white
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Outputs, PerOutput, Vector

ALIKE = 1.0
"""Neighbours in noise differ by √2 of its size; by once of it where as much of a residual is alike
in them as is noise (von Neumann's ratio)."""
FAR = 2.0
"""Times what the simplest description leaves that no noise leaves."""
SOME = 1e-6
"""Share of the measurement below which nothing is left."""


def missed(problem: Problem, values: Vector) -> PerOutput:
    """What is left of each output that is no noise, as a share of what the simplest description
    leaves, (ny,); infinite where a simulation runs away.

    Args:
        values: of the tuned parameters, (k,).
    """
    used = problem.rows.used
    r = np.where(used, problem.residuals(values), 0.0)
    if not np.isfinite(r).all():
        return np.where(np.isfinite(r).all(axis=0), 0.0, np.inf)
    r = np.where(used, r, np.nan)
    with np.errstate(over="ignore"):
        left, simple = mean_square(r, 0.0), _simplest(problem)
        alike = mean_square(np.diff(r, axis=0), 0.0) < ALIKE**2 * left
        astray = left > FAR**2 * simple  # alternating, too, as what runs away does
        some = left > SOME**2 * mean_square(np.where(used, problem.rows.y, np.nan), 0.0)
        if not (some & (alike | astray)).any():
            return np.zeros(len(left))
        rest = np.where(astray, left, np.maximum(left - _by_noise(problem, values, r), 0.0))
        share = np.sqrt(rest / np.where(simple > 0.0, simple, np.nan))
    on = some & (alike | astray) & (rest > 0.0)
    return np.asarray(np.where(on, np.nan_to_num(share, nan=np.inf), 0.0))


def _by_noise(problem: Problem, values: Vector, r: Outputs) -> PerOutput:
    """Mean square that white noise of the measurements leaves, by way of the starts too, (ny,)."""
    follows = (problem.restart.code == 0) & problem.rows.used.any(axis=1)
    noise = white(r, follows)
    total = np.square(noise)
    if noise.any():
        for (change,) in problem.by_starts([values], noise):
            counts = problem.rows.used & np.isfinite(change)
            more = mean_square(np.where(counts, change, np.nan), 0.0)
            total = total + np.nan_to_num(more, posinf=0.0)
    return np.asarray(total)


def _simplest(problem: Problem) -> PerOutput:
    """Mean square of what an output that stays leaves, (ny,)."""
    y, angles = np.where(problem.rows.used, problem.rows.y, np.nan), problem.model.outputs.angles
    count = np.maximum(np.isfinite(y).sum(axis=0), 1)
    mean = np.where(np.isfinite(y), y, 0.0).sum(axis=0) / count
    about = mean_square(wrap(y - mean, angles), 0.0)
    if not len(problem.model.states):
        return about
    adopts, rows = problem.restart.y, np.arange(len(y))[:, None]
    # a start on the way takes over what was measured in the row before it
    known = np.isfinite(adopts) | (problem.restart.code == ANEW)[:, None]
    last = np.maximum.accumulate(np.where(known, rows, 0), axis=0)
    begun = np.take_along_axis(adopts, np.vstack([last[:1], last[:-1]]), axis=0)
    stays = wrap(y - begun, angles)
    known = np.isfinite(stays).any(axis=0)
    return np.asarray(np.where(known, np.fmin(about, mean_square(stays, 0.0)), about))
