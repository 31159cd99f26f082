"""Rows whose prediction hangs on the noise of an input: they tell nothing of a form.

A machine that stands has a speed of no sign; a measured one has a sign by chance, and a law that
asks for it is off by all of its friction there, however right it is. So every input's noise is told
from its own rows, the predictions are taken again with as much noise added and taken away, and rows
that it moves far more than most, or up and down alike, and by something that counts beside the
residual, are none to judge a form by. The filter runs over the predictions as it does over the
measurements: it carries such a row's error to its neighbours, and they are found with it.

>>> rng, t = np.random.default_rng(0), np.arange(500) * 0.01
>>> seen = np.sin(t)[:, None] + rng.normal(0.0, 0.01, (500, 1))
>>> white(seen, np.ones(500, dtype=bool)).round(2).tolist()
[0.01]
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.models.batch import mapped
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Bool, Bools, Inputs, Outputs, PerOutput, Vector

COUNTS = 0.3
"""Part of the residual's noise from which what an input's noise does counts."""
USUAL = 3.0
"""Times what it does to a row as a rule, from which the row hangs on it."""
DRAWS, NEAR = 2, 5
"""Times that noise is drawn; rows before and after whose changes count as one row's."""
FEW = 30
"""Rows below which no noise is told."""


def hang(problem: Problem, values: Vector) -> Bool[np.ndarray, "n ny"]:
    """Which rows hang on the noise of an input.

    Args:
        problem: of a model without states.
        values: of the tuned parameters, (k,).
    """
    rows = problem.rows
    follows = np.isfinite(rows.u).all(axis=1) & (rows.dt > 0)
    noise = white(rows.u, follows)
    if not noise.any():
        return np.zeros(rows.y.shape, dtype=np.bool_)
    draws, here = np.random.default_rng(0), _predicted(problem, values, rows.u)
    moved, bent = np.zeros((2, *rows.y.shape))
    for _ in range(DRAWS):
        by = draws.standard_normal(rows.u.shape) * noise
        up, down = (_predicted(problem, values, u) - here for u in (rows.u + by, rows.u - by))
        moved += np.square(np.nan_to_num(up - down)) / 4.0
        bent += np.square(np.nan_to_num(up + down)) / 4.0
    size, bend = (np.sqrt(_around(one / DRAWS)) for one in (moved, bent))
    # of most rows: those that hang make a mean square theirs
    counts = COUNTS * _median(problem.residuals(values), rows.used) / 0.6745
    usual = USUAL * _median(size, rows.used)
    return np.asarray((bend > counts) | (size > np.maximum(counts, usual)))


def white(u: Inputs, follows: Bools) -> Vector:
    """Standard deviation of each input's noise, (nu,); 0 where its rows are too few, or smooth.

    Bends of third order hold little of what a machine does, and those of noise turn from row to
    row; what does neither, or does it seldom (steps of a command), is none.

    Args:
        follows: is a row the next of the one before? (n,)
    """
    bend = np.diff(u, 3, axis=0)
    bend[~(follows[1:-2] & follows[2:-1] & follows[3:])] = np.nan
    found = np.zeros(u.shape[1])
    for k, one in enumerate(bend.T):
        turned = -one[1:] * one[:-1]
        turned = turned[np.isfinite(turned)]
        if len(turned) >= FEW:
            usual = float(np.nanmedian(np.abs(one))) / 0.6745
            # of white noise σ bends have a variance of 20 σ², and neighbouring ones −15 σ²
            found[k] = np.sqrt(min(usual**2 / 20.0, max(float(turned.mean()), 0.0) / 15.0))
    return found


def _predicted(problem: Problem, values: Vector, u: Inputs) -> Outputs:
    """Filtered predictions at other inputs."""
    if problem.linear:  # without a column of what could be tuned
        y = mapped(problem.model, u, problem.rows.dt, problem.full(values))
        return np.asarray(problem.smooth(y))
    stops = np.cumsum([len(window.t) for window in problem.windows])
    parts = zip(problem.windows, np.split(u, stops[:-1]), strict=True)
    windows = tuple(window._replace(u=part) for window, part in parts)
    return replace(problem, windows=windows).predict(values)


def _median(of: Outputs, used: Bool[np.ndarray, "n ny"]) -> PerOutput:
    """Of each output's sizes on the rows that count; 0 where none do."""
    known = used & np.isfinite(of)
    return np.array([np.median(np.abs(one[at])) if at.any() else 0.0
                     for one, at in zip(of.T, known.T, strict=True)])  # fmt: skip


def _around(squares: Outputs) -> Outputs:
    """Mean of each row and its neighbours."""
    width = 2 * NEAR + 1
    total = np.cumsum(np.pad(squares, ((NEAR + 1, NEAR), (0, 0))), axis=0)
    return np.asarray(total[width:] - total[:-width]) / width
