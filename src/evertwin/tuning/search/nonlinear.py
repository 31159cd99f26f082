"""Nonlinear tuning: SciPy's trust-region least squares on predictions over one horizon.

Parameters are scaled to their natural size, bounds are kept, the Jacobian takes one roll-out per
parameter, all of them at once (`evertwin.models.batch`). Not converging is a value: the best
parameters so far, and a sentence with the cure.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> tank = FunctionModel(lambda x, u, dt, p: ([x[0] + dt * (u[0] - p[0] * x[0])],) * 2,
...     Layout.of(q="m/s"), Layout.of(h="m"), Layout.of(h="m"), Parameters.of(leak=(0.5, "1/s")))
>>> u = np.ones((20, 1))
>>> _, h = tank.simulate(np.zeros(1), u, np.full(20, 0.1), np.array([0.2]))
>>> rows = make_block(t=np.arange(20) * 10**8, u=u, y=np.concatenate([[[0.0]], h[:-1]]))
>>> outcome = least_squares(Problem(tank, (rows,)), Settings())
>>> outcome.values.round(4).tolist(), outcome.converged
([0.2], True)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from evertwin.signals.sizes import rms
from evertwin.tuning.intervals.assemble import Outcome, noise_of, squares
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.posing.settings import Settings
from evertwin.tuning.search.hypercube import layered
from evertwin.tuning.search.interrupt import Interrupt
from evertwin.types import PerOutput, Vector

__all__ = ["Objective", "Settings", "least_squares", "search"]


ROUNDS, SETTLED = 5, 0.1
"""Most searches, each with the noise that the one before left; its change that ends them."""
ROUGH = 1e-3
"""Relative change of the cost that ends a search that is repeated anyway."""
ENDLESS = 1e100
"""What no weighted residual reaches that does not run away; its square is a number."""
STOPPED = "stopped by the caller"
DULL = 0.01
"""Change of the cost that no row would notice, once rows are weighed by their noise."""


class _Stop(ArithmeticError):
    """The caller has had enough; never leaves this module."""


class Objective:
    """Weighted residuals over scaled parameters; remembers the best point seen.

    >>> Objective.__name__
    'Objective'
    """

    def __init__(
        self, problem: Problem, settings: Settings, free: np.ndarray, base: Vector
    ) -> None:
        self.problem, self.settings, self.free = problem, settings, free
        self.base, self.sizes = base, problem.sizes[free]
        self.weight = np.ones(len(problem.model.outputs))
        self.evaluations = 0
        self.seen: tuple[Any, Any, Any] = (None, None, None)
        """The last point with its residuals, and the weights that they have."""
        self.best: tuple[float, Vector] = (np.inf, np.zeros(int(np.count_nonzero(free))))
        self.interrupt = Interrupt(settings.interrupt)

    def values(self, z: Any) -> Vector:
        """All tuned parameters at scaled free ones."""
        out = self.base.copy()
        out[self.free] = self.base[self.free] + z * self.sizes
        return out

    def vectors(self, points: Sequence[Any]) -> list[Any]:
        """Weighted residuals of the rows that count, then the prior's pull, at several points."""
        values = [self.residual_values(z) for z in points]
        self.evaluations += len(points)
        return [
            self._weighted(one, r)
            for one, r in zip(values, self.problem.residuals_of(values), strict=True)
        ]

    def _weighted(self, values: Vector, r: Any) -> Any:
        rows = (r * self.weight)[self.problem.rows.used]
        pull = (values - self.problem.start) * np.sqrt(self.problem.information)
        out = np.concatenate([rows, pull[self.free]])
        return np.where(np.isnan(out), np.inf, out)

    def residual_values(self, z: Any) -> Vector:
        """The values that residuals are taken at; variable projection solves for some of them."""
        return self.values(z)

    def __call__(self, z: Any) -> Any:
        """Weighted residuals at one point, with progress."""
        (r,) = self.vectors([z])
        self.seen = np.array(z, dtype=np.float64), r, self.weight
        with np.errstate(over="ignore", invalid="ignore"):
            cost = 0.5 * float(r @ r)
        if cost < self.best[0]:
            self.best = cost, np.asarray(z, dtype=np.float64).copy()
        progress = self.settings.progress
        if progress is not None and progress(self.evaluations, cost) is False:
            raise _Stop
        if self.interrupt.asked:
            raise _Stop
        return r

    def jacobian(self, z: Any) -> Any:
        """Differences inside the bounds, one roll-out per parameter, all at once; none of what
        runs away."""
        low, high = self.bounds
        points = []
        for j in range(len(z)):
            step = 1e-6 * max(1.0, abs(float(z[j])))
            other = np.array(z, dtype=np.float64)
            other[j] = z[j] + step if z[j] + step <= high[j] else max(z[j] - step, low[j])
            points.append(other)
        at, centre, weight = self.seen
        # SciPy has just asked for the residuals here: they are known.
        if not (np.array_equal(at, z) and weight is self.weight):
            (centre,) = self.vectors([z])
        out = np.empty((len(centre), len(z)))
        for j, there in enumerate(self.vectors(points)):
            change = points[j][j] - z[j]
            with np.errstate(invalid="ignore"):
                out[:, j] = (there - centre) / change if change else 0.0
        return np.where(np.abs(out) < ENDLESS, out, 0.0)

    @property
    def bounds(self) -> tuple[Any, Any]:
        """Bounds of the scaled free parameters."""
        low, high = self.problem.bounds
        base = self.base[self.free]
        return (low[self.free] - base) / self.sizes, (high[self.free] - base) / self.sizes


def begun(problem: Problem, settings: Settings) -> Vector:
    """Where the search begins, (k,): the problem's start, but for what the settings say."""
    known = dict(settings.begin)
    pairs = zip(problem.names, problem.start.tolist(), strict=True)
    return np.array([known.get(name, value) for name, value in pairs])


def least_squares(
    problem: Problem,
    settings: Settings,
    free: np.ndarray | None = None,
    start: Vector | None = None,
) -> Outcome:
    """Tunes the ``free`` parameters (default: all); the others stay."""
    base = begun(problem, settings) if start is None else np.array(start)
    every = np.ones(len(base), dtype=np.bool_) if free is None else free
    if not every.any():
        return Outcome(base, 0, 0, True, "nothing to solve: no parameter is identifiable",
                       method="nonlinear")  # fmt: skip
    return search(Objective(problem, settings, every, base), "nonlinear")


def search(objective: Objective, method: str) -> Outcome:
    """Runs the starts, re-weights once, and says how it ended."""
    problem = objective.problem
    first = problem.residuals(objective.residual_values(np.zeros(len(objective.sizes))))
    objective.evaluations += 1
    lost = ~(np.abs(first) < ENDLESS) & problem.rows.used
    if lost.any():
        row, output = (int(i) for i in np.argwhere(lost)[0])
        name = problem.model.outputs.names[output]
        return Outcome(
            objective.base, 0, objective.evaluations, False,
            f"the simulation diverged at the start values ({name}, row {row}): start from other "
            "values, narrow the bounds or shorten the horizon", method=method,
        )  # fmt: skip
    objective.weight = 1.0 / _spread(problem, first)
    results: list[Any] = []
    try:
        with objective.interrupt:
            for z in _starts(objective):
                results.append(_run(objective, z, ROUGH if _rounds(problem) > 2 else 0.0))
                results.sort(key=lambda result: float(result.cost))
            for _ in range(_rounds(problem)):
                before = objective.weight
                results = [_again(objective, results[0])]
                if np.allclose(objective.weight, before, rtol=SETTLED):
                    break
    except _Stop:
        z = objective.best[1]
        return Outcome(
            objective.residual_values(z), len(results), objective.evaluations, False,
            f"{STOPPED} after {objective.evaluations} evaluations: the best values so "
            "far are kept", method=method,
        )  # fmt: skip
    return _outcome(objective, results[0], method)


def _again(objective: Objective, best: Any) -> Any:
    """The search repeated with the noise that the residual shows."""
    problem, count = objective.problem, len(objective.weight)
    left = squares(problem, problem.residuals(objective.residual_values(best.x)))
    objective.weight = 1.0 / noise_of(problem, left, np.full(count, len(best.x) / count))
    objective.best = np.inf, best.x  # costs of other weights do not compare
    return _run(objective, best.x, DULL / max(int(np.count_nonzero(problem.rows.used)), 1))


def _rounds(problem: Problem) -> int:
    """How often the noise is estimated anew from the residual and the search repeated."""
    if problem.scale is not None:
        return 0
    if problem.loss != "linear":
        return 2
    if problem.information.any():
        return ROUNDS  # what a prior weighs hangs on the noise, which was the whole deviation first
    return int(len(problem.model.outputs) > 1)


def _outcome(objective: Objective, best: Any, method: str) -> Outcome:
    problem = objective.problem
    names = [name for name, on in zip(problem.names, objective.free, strict=True) if on]
    hit = tuple(name for name, on in zip(names, best.active_mask, strict=True) if on)
    converged = best.status > 0
    message = f"converged after {best.nfev} evaluations"
    if not converged:
        message = (
            f"not converged after {best.nfev} evaluations: allow more (`evaluations`), start "
            "nearer, or give bounds"
        )
    if hit:
        message += f"; {', '.join(hit)} ended on a bound: widen it if that is not physical"
    values = objective.residual_values(best.x)
    return Outcome(
        values, int(best.njev or 0), objective.evaluations, converged, message, hit, method
    )


def _spread(problem: Problem, r: Any) -> PerOutput:
    """First guess of the noise: the residual at the start."""
    if problem.scale is not None:
        return problem.scale
    if problem.loss == "linear":
        sigma = rms(r)
    else:
        sigma = np.array([1.4826 * np.nanmedian(np.abs(c)) for c in r.T])
    floor = 1e-9 * np.nan_to_num(rms(problem.rows.y)) + 1e-300
    return np.asarray(np.maximum(np.nan_to_num(sigma, nan=1.0), floor))


def _starts(objective: Objective) -> list[Vector]:
    k = len(objective.sizes)
    low, high = objective.bounds
    inside = np.clip(np.zeros(k), low, high)
    extra = objective.settings.starts - 1
    if not extra:
        return [inside]
    low, high = np.maximum(low, -1e6), np.minimum(high, 1e6)
    low = np.where(low > -1e6, low, -1.0)
    high = np.where(high < 1e6, high, 1.0)
    points = layered(np.random.default_rng(objective.settings.seed), extra, k)
    return [inside, *(low + points * (high - low))]


def _run(objective: Objective, z: Vector, dull: float) -> Any:
    """One search; ``dull``: relative change of the cost that ends it, at least."""
    settings, (low, high) = objective.settings, objective.bounds
    # SciPy wants a start strictly inside, and its first step is about as long as the start is off
    # zero and its bound: one on a bound is moved, further where a short step would end the search.
    margin = np.minimum(0.01 if dull == ROUGH else 1e-6, 0.25 * (high - low))
    return scipy.optimize.least_squares(
        objective,
        np.clip(z, low + margin, high - margin),
        jac=objective.jacobian,
        bounds=(low, high),
        loss=objective.problem.loss,
        max_nfev=settings.evaluations,
        xtol=settings.tolerance,
        ftol=max(settings.tolerance, dull),
        gtol=1e-12,
    )
