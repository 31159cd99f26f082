"""A search that ended in a minimum which is not the least: begun anew, elsewhere.

A motion that is simulated can follow its measurement roughly with quite other numbers: two tanks in
a row that change places, a pendulum that goes over the top once more. What is left then is no
noise, since its neighbours are alike; so it is where the form is wrong, where no start leaves less.
Searches from many places (`evertwin.tuning.search.scattered`) and on ever more of the rows tell.

>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> u = np.ones((50, 1))
>>> rows = make_block(t=np.arange(50) * 10**8, u=u, y=0.11 * np.arange(50.0)[:, None])
>>> problem = Problem(Robot1D(), (rows,), ("gain",))
>>> [(name, round(value, 3)) for name, value in lowest(problem).settings.begin]
[('gain', 1.1)]
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from evertwin.fold import take
from evertwin.signals.sizes import rms
from evertwin.tuning.intervals.followed import missed
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.search.mixed import separable
from evertwin.tuning.search.nonlinear import least_squares
from evertwin.tuning.search.scattered import scattered
from evertwin.types import PerOutput, Vector

Enough: TypeAlias = Callable[[Problem, Vector], bool]

PARTS, FEWEST = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 0.36, 0.5, 0.6, 0.7, 0.8, 0.9), 20
"""Shares of each recording that are fitted before the whole, of so many rows at least: the longer a
motion, the less its end forgives."""
LITTLE = 0.03
"""Share of what an output does that a form leaves, and needs no other minimum to explain it."""
LESS = 0.9
"""Share of the residual that another minimum has to leave at most."""
NEAR = 1e-3
"""Relative change that ends a search on some of the rows: it only has to end near a minimum."""


def lowest(problem: Problem, enough: Enough = lambda _, values: False) -> Problem:
    """The problem; its search begins where a first one has led, or another that leaves less.

    Args:
        problem: what to tune, on what.
        enough: whether a problem's values do, though more than noise is left.
    """
    if problem.linear or separable(problem) or problem.settings.starts > 1:
        return problem
    with np.errstate(over="ignore", invalid="ignore"):  # what runs away is infinite
        values = least_squares(problem, problem.settings).values

        def does(one: Problem, values: Vector) -> bool:
            return enough(one, values) or _follows(one, values)

        if not does(problem, values):
            values = _less(problem, values, scattered(problem, values, does))
            if len(problem.model.states) and not does(problem, values):
                values = _less(problem, values, _grown(problem, values))
    begin = tuple(zip(problem.names, values.tolist(), strict=True))
    return replace(problem, settings=replace(problem.settings, begin=begin))


def _follows(problem: Problem, values: Vector) -> bool:
    """Is hardly more left than noise?"""
    return bool((missed(problem, values) <= LITTLE).all())


def _less(problem: Problem, values: Vector, other: Vector) -> Vector:
    """The one of both, or of where the other leads, that leaves less of all rows."""
    if np.array_equal(other, values):
        return values
    rough = replace(problem.settings, tolerance=NEAR)
    found = least_squares(problem, rough, start=other).values
    before, after = _left(problem, values), _left(problem, found)
    on = before > 0.0
    if not np.isfinite(after[on]).all() or not on.any():
        return values
    # an infinite residual is left behind by any other
    return (
        found if np.mean(np.where(np.isfinite(before), after / before, 0.0)[on]) < LESS else values
    )


def _grown(problem: Problem, values: Vector) -> Vector:
    """Where searches on ever more of each recording lead: a short motion has one minimum, and what
    is found there begins near that of a longer."""
    rough = replace(problem.settings, tolerance=NEAR)
    for part in PARTS:
        some = tuple(take(w, 0, max(math.ceil(part * len(w.t)), FEWEST)) for w in problem.windows)
        prior = problem.parameters.with_values(problem.full(values))
        part_of = replace(problem, windows=some, prior=prior)
        values = least_squares(part_of, rough, start=values).values
    return values


def _left(problem: Problem, values: Vector) -> PerOutput:
    """Rms residual per output, (ny,); infinite where a simulation runs away."""
    r, used = problem.residuals(values), problem.rows.used
    lost = (used & ~np.isfinite(r)).any(axis=0)
    return np.where(lost, np.inf, rms(np.where(used, r, np.nan), 0.0))
