"""Numbers inside a linear model's columns: found beside the linear ones, and carried into these.

The width of a friction's switch, the speed at which its peak has fallen: a model is linear but for
them. At a point it is so in them, too: each has the column that its output changes by. So a search
is a row of closed forms, each from the point that the one before has led to (Gauss-Newton), and an
interval of a linear number counts what the rows leave open of those inside of its column.

>>> from evertwin.fold import make_block
>>> from evertwin.machines.drive import DriveForce
>>> from evertwin.tuning import solve
>>> rng, t = np.random.default_rng(0), np.arange(4000) * 0.01
>>> v = np.sin(0.7 * t) * np.sin(0.13 * t)
>>> friction = np.tanh(v / 0.02) * (5.0 + 2.0 * np.exp(-((v / 0.1) ** 2)))
>>> y = (friction + rng.normal(0.0, 0.2, 4000))[:, None]
>>> rows = make_block(t=(t * 1e9).astype(np.int64), u=np.stack([v, 0.0 * v], axis=1), y=y)
>>> problem = Problem(DriveForce("tanh+stribeck"), (rows,), ("Fv", "Fc", "Fs"))
>>> low, high = solve(problem).interval("Fs")
>>> found = searched(problem, (("vs", "width"),))
>>> [round(found.parameters[name].value, 2) for name in ("vs", "width")]
[0.1, 0.02]
>>> near = solve(leaning(found, solve(found).p, (("vs", "width"),)))
>>> low < 2.0 < high, near.interval("Fs")[0] < 2.0 < near.interval("Fs")[1]
(False, True)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from evertwin.models import LinearModel, Parameters
from evertwin.models.compiled import StaticMap
from evertwin.signals import Layout
from evertwin.tuning.intervals.fit import Fit
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.solver import closed
from evertwin.types import (
    Float64,
    Inputs,
    Int64,
    Intervals,
    Outputs,
    ParameterVector,
    Rollout,
    StateVector,
    Vector,
)

Inside: TypeAlias = Sequence[Sequence[str]]
"""Of each output the numbers that its columns are not linear in."""
ROUNDS, HALVED = 12, 3
"""Steps at most, and how often each may be halved."""
SETTLED = 1.0
"""Logarithm of the likelihood that a step has to bring, else the search ends."""
FURTHEST = np.log(2.0)
"""Longest step, in the logarithm of a number."""
LOOSE = 1.0
"""Standard deviation of such a number that no row tells, as a part of it."""
STEP = 1e-3
"""Of the differences, as a part of a number."""


@dataclass(frozen=True, eq=False)
class Tangent(StaticMap):
    """A model that is linear in more of its numbers, near a point.

    >>> from evertwin.machines.drive import DriveForce
    >>> axis = DriveForce("tanh+stribeck")
    >>> near = Tangent(axis, (("vs", "width"),), axis.parameters.values)
    >>> [near.parameters.names[k] for k in near.columns[0, -2:]]
    ['vs', 'width']
    """

    model: LinearModel
    inside: Inside
    point: ParameterVector

    @property
    def inputs(self) -> Layout:
        """The model's."""
        return self.model.inputs

    @property
    def outputs(self) -> Layout:
        """The model's."""
        return self.model.outputs

    @property
    def parameters(self) -> Parameters:
        """The model's."""
        return self.model.parameters

    @cached_property
    def _places(self) -> Int64[np.ndarray, "ny s"]:
        """Of the numbers inside each output's columns; −1: none."""
        found = np.full((len(self.inside), max(map(len, self.inside), default=0)), -1)
        for o, names in enumerate(self.inside):
            found[o, : len(names)] = self.parameters.indices(tuple(names))
        return found

    @cached_property
    def columns(self) -> Int64[np.ndarray, "ny m"]:
        """The model's, then those of the numbers inside."""
        return np.concatenate([np.asarray(self.model.columns), self._places], axis=1)

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """As the model does."""
        return self.model.simulate(x, u, dt, p)

    def regressor(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[Outputs, Float64[np.ndarray, "n ny m"]]:
        """The model's at the point, and how its outputs change there."""
        at, places = self.point, self._places
        here = p.copy()
        here[places[places >= 0]] = at[places[places >= 0]]
        y0, phi = self.model.regressor(x, u, dt, here)
        before = self._outputs(x, u, dt, at)
        more, y0 = np.zeros((*y0.shape, places.shape[1])), y0.copy()
        for a, own in enumerate(places.T):
            mine = own >= 0
            step, moved = STEP * at[own[mine]], at.copy()
            moved[own[mine]] += step
            change = self._outputs(x, u, dt, moved)[:, mine] - before[:, mine]
            more[:, mine, a] = change / step
            y0[:, mine] -= more[:, mine, a] * at[own[mine]]
        return y0, np.concatenate([phi, more], axis=2)

    def _outputs(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Outputs:
        y0, phi = self.model.regressor(x, u, dt, p)
        columns = np.asarray(self.model.columns)
        y = y0 + np.einsum("ika,ka->ik", phi, np.where(columns < 0, 0.0, p[columns]))
        return np.asarray(y)


def leaning(problem: Problem, p: ParameterVector, inside: Inside) -> Problem:
    """The problem near a point, with the numbers inside its columns among those that are tuned.
    What is tuned otherwise starts where it did."""
    names = tuple(name for some in inside for name in some)
    at = zip(problem.model.parameters.names, p.tolist(), strict=True)
    items = problem.parameters.with_values({n: value for n, value in at if n not in problem.names})
    items = Parameters(
        tuple(
            replace(item, sigma=min(item.sigma, LOOSE * item.value)) if item.name in names else item
            for item in items
        )
    )
    model: Any = Tangent(problem.model, inside, p)  # type: ignore[arg-type]
    names = (*problem.names, *(name for name in names if name not in problem.names))
    return replace(problem, model=model, editable=names, prior=items)


def searched(problem: Problem, inside: Inside) -> Problem:
    """A linear problem with the numbers inside its columns where they leave least."""
    names = [name for some in inside for name in some]
    if not names:
        return problem
    here, values, cost = problem, *_least(problem)
    for _ in range(ROUNDS):
        near = leaning(here, here.full(values), inside)
        found = dict(zip(near.names, closed(near)[0].tolist(), strict=True))
        items = [here.parameters[name] for name in names]
        now, low, high = np.array([(item.value, item.low, item.high) for item in items]).T
        step = np.array([found[name] for name in names]) / now - 1.0
        step = np.clip(step, -FURTHEST, FURTHEST)
        for _ in range(HALVED):
            moved = np.clip(now * np.exp(step), low, high)
            speeds = dict(zip(names, moved.tolist(), strict=True))
            there = replace(here, prior=here.parameters.with_values(speeds))
            new, less = _least(there)
            if less < cost:
                break
            step = step / 2.0
        else:
            break
        gain, here, values, cost = cost - less, there, new, less
        if gain < SETTLED:
            break
    return here


def _least(problem: Problem) -> tuple[Vector, float]:
    """(the linear numbers, minus the logarithm of the likelihood of what they leave)."""
    values = closed(problem)[0]
    r = np.where(problem.rows.used, problem.residuals(values), np.nan)
    rows = np.maximum(np.count_nonzero(~np.isnan(r), axis=0), 1)
    mean = np.nansum(np.square(r), axis=0) / rows
    return values, float(0.5 * rows @ np.log(np.maximum(mean, 1e-300)))


def told(fit: Fit, near: Fit, start: Parameters) -> Fit:
    """A fit with what the problem near it says of its numbers, and of those inside its columns.

    Args:
        fit: of the linear numbers, whose values stay.
        near: of the problem that leans on it.
        start: has those inside as they were found.
    """
    k, inside = len(fit.names), [name for name in near.names if name not in fit.names]
    names = (*fit.names, *inside)
    here = [names.index(name) for name in near.names]
    found = [start[name].value for name in inside]
    values = np.append(fit.values, found)
    sigma, interval95 = np.full(len(names), np.inf), np.tile([-np.inf, np.inf], (len(names), 1))
    units, verdict, reasons = [*fit.units], [*fit.verdict], [*fit.reasons]
    units += [start[name].unit for name in inside]
    verdict, reasons = verdict + [""] * len(inside), reasons + [""] * len(inside)
    sigma[:k], interval95[:k] = fit.sigma, fit.interval95
    sigma[here], interval95[here] = near.sigma, near.interval95
    interval95[:, 0] = np.minimum(interval95[:, 0], values)
    interval95[:, 1] = np.maximum(interval95[:, 1], values)
    covariance = np.diag(np.square(sigma))
    covariance[np.ix_(here, here)] = near.covariance
    for j, place in enumerate(here):
        (low, high), value = near.interval95[j].tolist(), float(values[place])
        if place < k and not low <= value <= high:  # the point is another one
            if verdict[place] == "not":  # it stays as it was, whatever others would be with it
                interval95[place], sigma[place] = (-np.inf, np.inf), np.inf
                continue
            verdict[place] = "weak"
            reasons[place] = _elsewhere(reasons[place], near, j)
            continue
        kept = [part for part in reasons[place].split("; ") if part.startswith("told with ")]
        verdict[place] = near.verdict[j]
        reasons[place] = "; ".join(filter(None, (*kept, near.reasons[j])))
    return replace(
        fit, names=names, units=tuple(units), values=values, sigma=sigma, interval95=interval95,
        start=np.append(fit.start, found), covariance=covariance,
        verdict=tuple(verdict), reasons=tuple(reasons),
    )  # fmt: skip


def _elsewhere(before: str, near: Fit, j: int) -> str:
    """Why a number is weak whose value the problem near it denies."""
    half = float(np.diff(near.interval95[j])[0]) / 2.0
    said = f"where others that act alike may move too it is {near.values[j]:.4g} ± {half:.2g}"
    return "; ".join(filter(None, (before, said)))
