"""Variable projection: linear parameters solved inside, nonlinear ones searched outside.

A sensor's delay, the width of a friction law or a gain inside a nonlinearity make an otherwise
linear model nonlinear in one or two parameters only. For given nonlinear parameters θ the linear
ones have a closed form, so that the search runs over θ alone (Golub and Pereyra 1973): fewer
dimensions, no start values for the linear part, better conditioned.

>>> linear_places(np.array([[0, 2], [1, -1]]), np.array([2, 3]))
array([ True, False])
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from evertwin.models import LinearModel
from evertwin.tuning.intervals.assemble import Outcome
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.search.nonlinear import Objective, Settings, search
from evertwin.types import Vector


def linear_places(columns: np.ndarray, places: np.ndarray) -> np.ndarray:
    """True for tuned parameters that have a regressor column, (k,)."""
    return np.isin(places, columns[columns >= 0])


def separable(problem: Problem) -> bool:
    """True if some, but not all, tuned parameters are linear."""
    model = problem.model
    if not isinstance(model, LinearModel) or len(model.states) or model.outputs.angles.any():
        return False
    linear = linear_places(np.asarray(model.columns), problem.places)
    return bool(linear.any() and not linear.all())


class Projected(Objective):
    """The objective over the nonlinear parameters; the linear ones follow from them.

    >>> Projected.__name__
    'Projected'
    """

    def __init__(
        self, problem: Problem, settings: Settings, free: np.ndarray, linear: np.ndarray
    ) -> None:
        super().__init__(problem, settings, free & ~linear, problem.start.copy())
        self.linear = free & linear
        columns = np.asarray(problem.model.columns)  # type: ignore[attr-defined]
        self.at = np.full(columns.shape, -1, dtype=np.int64)
        for j, place in enumerate(problem.places[self.linear].tolist()):
            self.at[columns == place] = j

    def residual_values(self, z: Any) -> Vector:
        """Nonlinear values from ``z``, linear ones in closed form."""
        values = self.values(z)
        a, b = self._rows(values)
        size = np.sqrt(np.square(a).sum(axis=0))
        size[size == 0] = 1.0
        change = np.linalg.lstsq(a / size, b, rcond=1e-10)[0] / size
        values[self.linear] += change
        low, high = (bound[self.linear] for bound in self.problem.bounds)
        solved = values[self.linear]
        if ((solved < low) | (solved > high)).any():
            start = solved - change
            bounds = (low - start) * size, (high - start) * size
            change = scipy.optimize.lsq_linear(a / size, b, bounds=bounds).x / size
            values[self.linear] = np.clip(start + change, low, high)
        return values

    def _rows(self, values: Vector) -> tuple[Any, Any]:
        """Weighted regressor and residual of the rows that count, then the prior's."""
        problem = self.problem
        p = problem.full(values)
        columns = problem.model.columns  # type: ignore[attr-defined]
        y0, phi = problem.regressor(values)
        r = problem.rows.y - y0 - (phi * np.where(columns < 0, 0.0, p[columns])).sum(axis=2)
        used, k = problem.rows.used, int(self.linear.sum())
        known = used & np.isfinite(r)
        a = np.zeros((*phi.shape[:2], k))
        for o, m in np.argwhere(self.at >= 0).tolist():
            a[:, o, self.at[o, m]] += phi[:, o, m]
        information = np.diag(np.sqrt(problem.information[self.linear]))
        pull = information @ (problem.start - values)[self.linear]
        weighted = (a * self.weight[:, None])[known]
        return np.concatenate([weighted, information]), np.concatenate(
            [(r * self.weight)[known], pull]
        )


def project(problem: Problem, settings: Settings, free: np.ndarray) -> Outcome:
    """Tunes a separable problem; parameters that are not ``free`` stay."""
    columns = np.asarray(problem.model.columns)  # type: ignore[attr-defined]
    linear = linear_places(columns, problem.places)
    return search(Projected(problem, settings, free, linear), "variable projection")
