"""Numbers that hang on a term of the form: what they would be without it.

A term that joins takes from the others what acts like it. At the optimum the rest of a fit without
parameters ``s`` is its own value plus ``N_rr⁻¹ N_rs θ_s``, with ``N`` the normal matrix (the bias
of an omitted variable): exact for a linear model, a Gauss-Newton step for others. Where that lies
outside the interval of the fit with the term, the number is one of this form only, and it is said.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> from evertwin.tuning import solve
>>> law = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0] + p[1] * u[0] ** 3]),
...     Layout.of(z="m"), Layout.of(force="N"),
...     parameters=Parameters.of(stiffness=(1.0, "N/m"), cubic=(0.0, "N/m^3")))
>>> z = np.linspace(-1.0, 1.0, 60)[:, None]
>>> noise = np.random.default_rng(0).normal(0.0, 0.01, (60, 1))
>>> problem = Problem(law, (make_block(t=np.arange(60), u=z, y=3.0 * z + z**3 + noise),))
>>> moved(problem, solve(problem), {"cubic": ("cubic",)}).reasons
('moves with the form: 3.62 without cubic', '')
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evertwin.tuning.intervals.fit import Amend, Fit
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Float64, Vector


def moved(problem: Problem, fit: Fit, terms: Mapping[str, tuple[str, ...]]) -> Fit:
    """The fit, with what other numbers would be without each of ``terms`` (name → parameters).

    Said is the term that a number hangs on most; values, intervals and verdicts stay.
    """
    free = np.array([verdict != "not" for verdict in fit.verdict])
    products = normal(problem, fit) if terms and fit.converged else None
    if products is None:
        return fit
    half = np.diff(fit.interval95, axis=1)[:, 0] / 2.0
    worst, found = np.ones(len(free)), dict[int, Amend]()
    for name, added in terms.items():
        out = np.array([one in added for one in fit.names]) & free
        rest = free & ~out
        if not out.any() or not rest.any():
            continue
        side = products[np.ix_(rest, out)] @ fit.values[out]
        shift = shifted(products[np.ix_(rest, rest)], side)
        for k, by in zip(np.flatnonzero(rest).tolist(), shift.tolist(), strict=True):
            if half[k] > 0 and abs(by) / half[k] > worst[k]:
                worst[k] = abs(by) / half[k]
                said = f"moves with the form: {fit.values[k] + by:.3g} without {name}"
                found[k] = Amend(why=(said,))
    return fit.amended(found)


def shifted(products: Float64[np.ndarray, "k k"], side: Vector) -> Vector:
    """How far numbers move to make up for ``side``, (k,), whatever their units; not at all where
    the sums are beyond reckoning."""
    if not (np.isfinite(products).all() and np.isfinite(side).all()):
        return np.zeros(len(side))
    size = np.sqrt(products.diagonal())
    size = np.where(size > 0.0, size, 1.0)
    unit = products / np.outer(size, size)
    return np.asarray(np.linalg.lstsq(unit, side / size, rcond=None)[0] / size)


def normal(problem: Problem, fit: Fit) -> Float64[np.ndarray, "k k"] | None:
    """Products of the columns of the tuned parameters, over rows that count; None: none are."""
    acting = problem.sensitivity(fit.values)
    if not acting.finite:
        return None
    known = problem.rows.used & np.isfinite(problem.residuals(fit.values))
    total = np.zeros((len(fit.names), len(fit.names)))
    for o, at in enumerate(acting.at):
        here = np.flatnonzero(at >= 0)
        columns = acting.columns[known[:, o], o][:, here] / fit.noise[o]
        np.add.at(total, np.ix_(at[here], at[here]), columns.T @ columns)
    return total
