"""Numbers that hang on how long the steps of a model are: what its integration errs by.

A step that takes a row at once, or in a few parts, follows a motion that is faster than these only
roughly, and a number that is fitted makes up for it: of a mass that its damper stops within a part
of a step, a third or more is missing, and more rows only make that more certain. So the rows are
simulated once more, each in two halves. Where the model is one in time the difference is what its
integration errs by, or a third of it (a rule of first order, L. F. Richardson 1911); what a
number would change by to make up for that widens its interval. A model that knows no time, or whose
halves are another machine that no numbers make alike, is one of rows: nothing is said of it.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> from evertwin.tuning import solve
>>> v = Layout.of(v="m/s")
>>> def cart(x, u, dt, p):
...     speed = (x[0] + dt * u[0] / p[0]) / (1.0 + dt * 5.0 / p[0])  # implicit
...     return [speed], [speed]
>>> model = FunctionModel(cart, Layout.of(f="N"), v, v, Parameters.of(m=(1.0, "kg")))
>>> u = np.repeat(np.random.default_rng(0).normal(size=40), 10)[:, None]
>>> fine = np.repeat(u, 20, axis=0), np.full(8000, 0.005), np.ones(1)
>>> y = model.simulate(np.zeros(1), *fine)[1][19::20]
>>> rows = make_block(t=10**8 * np.arange(1, 401), u=u, y=y)
>>> problem = Problem(model, (rows,))
>>> fit = solve(problem)
>>> [round(end, 2) for one in (fit, stepped(problem, fit)) for end in one.interval("m")]
[0.78, 0.78, 0.45, 1.12]
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.models import Restart
from evertwin.models.kernels.kernel import ANEW
from evertwin.signals import wrap
from evertwin.tuning.form.omitted import shifted
from evertwin.tuning.intervals.fit import Amend, Fit
from evertwin.tuning.intervals.identifiability import grade
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.posing.rows import Rows
from evertwin.types import Outputs, Vector

WHOLE = 3.0
"""Times what half a step changes that no step at all would: twice, of a rule of first order, and
more where the steps are long."""
OTHER = 0.5
"""Share of what halves change that numbers have to make up for, else it is another machine."""


def stepped(problem: Problem, fit: Fit) -> Fit:
    """The fit, whose intervals carry what the steps of the model err by. Values stay."""
    free = np.array([verdict != "not" for verdict in fit.verdict])
    if problem.linear or problem.filter is not None or not len(problem.model.states):
        return fit
    change = _halved(problem, fit.values) if free.any() and fit.converged else None
    if change is None:
        return fit
    columns = problem.jacobian(fit.values)[:, :, free] / fit.noise[:, None]
    used = problem.rows.used & np.isfinite(change) & np.isfinite(columns).all(axis=2)
    columns, change = columns[used], (change / fit.noise)[used]
    by = shifted(columns.T @ columns, columns.T @ change)
    if np.square(change - columns @ by).sum() > OTHER * np.square(change).sum():
        return fit
    half, by = np.diff(fit.interval95)[free, 0] / 2.0, WHOLE * np.abs(by)
    return _told(fit, np.flatnonzero(free), np.where(by > half, by, 0.0))


def _told(fit: Fit, places: np.ndarray, more: Vector) -> Fit:
    found = dict[int, Amend]()
    for k, by in zip(places.tolist(), more.tolist(), strict=True):
        if not by:
            continue
        low, high = (fit.interval95[k] + (-by, by)).tolist()
        half, value = (high - low) / 2.0, abs(float(fit.values[k]))
        (word,), (wide,) = grade([""], np.array([half / value if value else np.inf]))
        said = f"hangs on the step of the model (± {by:.2g}): take shorter ones in it"
        found[k] = Amend((low, high), "" if word == "identifiable" else "weak", (said, wide))
    return fit.amended(found)


def _halved(problem: Problem, values: Vector) -> Outputs | None:
    """How predictions (n, ny) change where each row is simulated in two halves; None: the model
    knows no time."""
    here, angles = problem.predict(values), problem.model.outputs.angles
    rows, (y, code, x0) = problem.rows, problem.restart
    faster = problem.tuning(problem.names)
    faster.__dict__["rows"] = replace(rows, dt=rows.dt / 2.0)
    if np.array_equal(faster.predict(values), here, equal_nan=True):
        return None
    twice = problem.tuning(problem.names)
    y2, used, moving = (np.repeat(one, 2, axis=0) for one in (rows.y, rows.used, rows.moving))
    u, dt = np.repeat(rows.u, 2, axis=0), np.repeat(rows.dt / 2.0, 2)
    twice.__dict__["rows"] = Rows(u, dt, y2, used, moving, ())
    codes = np.repeat(code, 2)
    codes[1::2] = np.where(code >= ANEW, code, 0)  # the second half goes on
    twice.__dict__["restart"] = Restart(np.repeat(y, 2, axis=0), codes, x0)
    twice.__dict__["_recordings"] = [
        one._replace(first=2 * one.first, stop=2 * one.stop) for one in problem._recordings
    ]
    return np.asarray(wrap(twice.predict(values)[1::2] - here, angles))
