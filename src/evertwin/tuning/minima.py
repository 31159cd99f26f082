"""A search that ended in a minimum which is not the least: begun anew, on ever more of the rows.

A motion that is simulated can follow its measurement roughly with quite other numbers: two tanks in
a row that change places, a pendulum that goes over the top once more. What is left then is no
noise, since its neighbours are alike; so it is where the form is wrong, where no start leaves less.

>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> u = np.ones((50, 1))
>>> rows = make_block(t=np.arange(50) * 10**8, u=u, y=0.11 * np.arange(50.0)[:, None])
>>> problem = Problem(Robot1D(), (rows,), ("gain",))
>>> lowest(problem) is problem
True
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from evertwin.fold import take
from evertwin.tuning.assemble import rms
from evertwin.tuning.nonlinear import least_squares
from evertwin.tuning.problem import Problem
from evertwin.types import PerOutput, Vector

PARTS, FEWEST = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 0.36, 0.5, 0.6, 0.7, 0.8, 0.9), 20
"""Shares of each recording that are fitted before the whole, of so many rows at least: the longer a
motion, the less its end forgives."""
ALIKE = 1.0
"""Neighbours in noise differ by √2 of its size; by once of it where as much of a residual is alike
in them as is noise (von Neumann's ratio)."""
SOME = 1e-6
"""Share of the measurement below which nothing is left."""
LESS = 0.9
"""Share of the residual that another minimum has to leave at most."""
NEAR = 1e-3
"""Relative change that ends a search on some of the rows: it only has to end near a minimum."""


def lowest(problem: Problem) -> Problem:
    """The problem; begun where fits to ever more rows lead, if what is left there is less."""
    if problem.linear or not len(problem.model.states) or problem.settings.starts > 1:
        return problem
    left, alike = _left(problem, least_squares(problem, problem.settings).values)
    if not alike:
        return problem
    found = least_squares(problem, problem.settings, start=_grown(problem)).values
    share = _left(problem, found)[0][left > 0.0] / left[left > 0.0]
    if not (len(share) and np.mean(share) < LESS):
        return problem
    return replace(problem, prior=problem.parameters.with_values(problem.full(found)))


def _grown(problem: Problem) -> Vector:
    """Where searches on ever more of each recording lead: a short motion has one minimum, and what
    is found there begins near that of a longer."""
    values, rough = problem.start, replace(problem.settings, tolerance=NEAR)
    for part in PARTS:
        some = tuple(take(w, 0, max(math.ceil(part * len(w.t)), FEWEST)) for w in problem.windows)
        prior = problem.parameters.with_values(problem.full(values))
        values = least_squares(replace(problem, windows=some, prior=prior), rough).values
    return values


def _left(problem: Problem, values: Vector) -> tuple[PerOutput, bool]:
    """Rms residual per output, (ny,), and are neighbours in one alike?"""
    r = np.where(problem.rows.used, problem.residuals(values), np.nan)
    left, some = rms(r), SOME * rms(problem.rows.y)
    return left, bool(((rms(np.diff(r, axis=0)) < ALIKE * left) & (left > some)).any())
