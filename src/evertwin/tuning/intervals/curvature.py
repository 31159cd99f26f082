"""Numbers that the rows bend with: what is so sensitive to them that no slope tells an interval.

An interval is told by slopes: how predictions change with a number where it is. A ball that bounces
a hundred times, or a simulation near the edge of running away, changes altogether within what its
noise seems to leave open, so there other values fit as well, and some fit better. So each number is
moved by that much, to either side, the others with it as they lean on it. Where predictions do not
change as the slopes said, nothing is known of the number (Bates and Watts, "Relative curvature
measures of nonlinearity", 1980).

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> from evertwin.tuning import solve
>>> x = Layout.of(x="1")
>>> def logistic(x, u, dt, p):
...     return ([p[0] * x[0] * (1.0 - x[0])],) * 2
>>> def told(growth):
...     parameters = Parameters.of(growth=(growth, "1"))
...     model = FunctionModel(logistic, Layout.of(u="1"), x, x, parameters)
...     y = model.simulate(np.array([0.3]), np.zeros((60, 1)), np.ones(60), np.array([growth]))[1]
...     y += np.random.default_rng(0).normal(0.0, 0.01, y.shape)
...     problem = Problem(model, (make_block(t=10**9 * np.arange(60), u=0.0 * y, y=y),))
...     return unbent(problem, solve(problem)).verdict
>>> told(3.2), told(3.7)
(('identifiable',), ('weak',))
"""

from __future__ import annotations

import numpy as np

from evertwin.signals import wrap
from evertwin.tuning.intervals.fit import Amend, Fit
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Vector

SIDE = 2.0
"""Standard deviations by white noise that a number is moved by."""
BENT = 1.0
"""Share of the change by which predictions change otherwise that leaves nothing of the slopes."""
ALIKE = 1e-9
"""Share of the information of the best told direction below which none is told."""
WHY = "no interval holds: within it predictions change other than by their slopes"


def unbent(problem: Problem, fit: Fit) -> Fit:
    """The fit; numbers that predictions bend with have no interval, and are weak. Values stay."""
    free = np.flatnonzero([verdict != "not" for verdict in fit.verdict])
    if problem.linear or not len(free) or not fit.converged:
        return fit
    shares = _bent(problem, fit)
    bent = Amend((-np.inf, np.inf), "weak", (WHY,))
    return fit.amended(dict.fromkeys(free[shares[free] >= BENT].tolist(), bent))


def _bent(problem: Problem, fit: Fit) -> Vector:
    """Share by which predictions change otherwise than by their slopes, on the worse side, (k,)."""
    columns = problem.jacobian(fit.values) / fit.noise[:, None]
    used = problem.rows.used & np.isfinite(columns).all(axis=2)
    columns = columns[used]
    size, points = np.linalg.norm(columns, axis=0), list[Vector]()
    if not np.isfinite(size).all():
        return np.full(len(size), np.inf)
    unit = np.where(size > 0.0, size, 1.0)  # numbers that tell nothing of others stay
    alike = columns / unit
    covariance = np.linalg.pinv(alike.T @ alike, rcond=ALIKE, hermitian=True)
    for k, way in enumerate(covariance):  # the others go with it, as they lean on it
        by = SIDE * way / np.sqrt(max(float(way[k]), 1e-300)) / unit
        points += [np.clip(fit.values + side, *problem.bounds) for side in (by, -by)]
    here, angles, shares = problem.predict(fit.values), problem.model.outputs.angles, []
    for point, there in zip(points, problem.predictions(points), strict=True):
        change = (wrap(there - here, angles) / fit.noise)[used]
        slope = columns @ (point - fit.values)
        square = np.square(slope).sum()
        shares.append(np.sqrt(np.square(change - slope).sum() / square) if square > 0.0 else 0.0)
    return np.asarray(np.nan_to_num(shares, nan=np.inf).reshape(-1, 2).max(axis=1))
