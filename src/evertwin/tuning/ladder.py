"""A ladder of variants, climbed only while held-out error falls.

Variants of a model (friction laws, say) are ordered from simple to rich and named before any of
them is scored. Each is tuned on all windows but a fold and scored on that fold, in turn. A rung is
taken only if its held-out error is lower than that of the rung stood on by more than ``gain``
(5 %: less is no improvement); a rung that does not pay is skipped, and ``patience`` of them in a
row end the climb. Outputs that share no parameters may stand on different rungs.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> def law(*powers):
...     names = {f"c{n}": (1.0, "1") for n in powers}
...     def step(x, u, dt, p): return [], [sum(c * u[0] ** n for c, n in zip(p, powers))]
...     return FunctionModel(step, Layout.of(u="1"), Layout.of(y="1"),
...         parameters=Parameters.of(**names))
>>> rng = np.random.default_rng(0)
>>> def window():
...     u = rng.uniform(-1, 1, (60, 1))
...     return make_block(t=np.arange(60), u=u, y=u + u**2 + rng.normal(0, 0.01, (60, 1)))
>>> rungs = {"line": law(1), "parabola": law(1, 2), "quartic": law(1, 2, 3, 4)}
>>> climbed = climb(rungs, Problem(rungs["line"], (window(), window(), window())))
>>> climbed.chosen
'parabola'
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from evertwin.errors import UsageError
from evertwin.models import Model
from evertwin.tuning.assemble import rms
from evertwin.tuning.problem import Problem
from evertwin.tuning.settings import Settings
from evertwin.tuning.solver import solve
from evertwin.types import Float64

__all__ = ["Climb", "climb", "held_out"]


@dataclass(frozen=True)
class Climb:
    """What the rungs scored on rows they had not seen.

    >>> Climb(("a", "b"), ("y",), np.array([[2.0], [1.0]]), "b", ("b",)).gain
    0.5
    """

    rungs: tuple[str, ...]
    outputs: tuple[str, ...]
    error: Float64[np.ndarray, "rungs ny"]
    """Held-out rms residual, in units of the first rung's; NaN for rungs not climbed to."""
    chosen: str
    per_output: tuple[str, ...]
    """The rung that each output alone would stand on."""

    @property
    def gain(self) -> float:
        """Share of the first rung's held-out error that the chosen one takes away."""
        pooled = _pooled(self.error)
        return 1.0 - float(pooled[self.rungs.index(self.chosen)] / pooled[0])


def climb(
    rungs: Mapping[str, Model],
    problem: Problem,
    gain: float = 0.05,
    patience: int = 1,
    folds: int | None = None,
    settings: Settings | None = None,
) -> Climb:
    """Climbs.

    Args:
        rungs: models from simple to rich; all editable parameters of each are tuned.
        problem: windows, horizon, filter and scale; its model is not used.
        gain: least relative fall of the held-out error that counts.
        patience: rungs in a row that do not pay before the climb ends.
        folds: number of folds over the windows; default: one window each, at most 10.

    Raises:
        UsageError: fewer than two windows, or no rung.
    """
    if len(problem.windows) < 2 or not rungs:
        raise UsageError(
            f"ladder: expected at least 2 windows and 1 rung, got {len(problem.windows)} and "
            f"{len(rungs)}: cut the data into windows (tasks)"
        )
    names = tuple(rungs)
    errors: list[np.ndarray] = []
    chosen, misses = 0, 0
    for number, name in enumerate(names):
        errors.append(held_out(_of(rungs[name], problem), folds, settings))
        if number == 0:
            continue
        here, there = _pooled(np.array(errors) / errors[0])[[chosen, number]]
        if there < (1.0 - gain) * here:
            chosen, misses = number, 0
        else:
            misses += 1
        if misses >= patience:
            break
    relative = np.full((len(names), len(errors[0])), np.nan)
    relative[: len(errors)] = np.array(errors) / errors[0]
    best = tuple(names[_stand(column, gain, patience)] for column in relative.T)
    return Climb(names, problem.model.outputs.names, relative, names[chosen], best)


def _of(model: Model, problem: Problem) -> Problem:
    """The problem with another model and all its editable parameters."""
    return replace(problem, model=model, editable=(), prior=None)


def held_out(
    problem: Problem, folds: int | None = None, settings: Settings | None = None
) -> Float64[np.ndarray, " ny"]:
    """rms residual of each output over windows that were left out of the tuning, (ny,).

    A fold whose tuning diverged counts as infinitely bad.
    """
    n = len(problem.windows)
    count = min(folds or min(n, 10), n)
    parts = []
    for fold in range(count):
        test = tuple(w for i, w in enumerate(problem.windows) if i % count == fold)
        train = tuple(w for i, w in enumerate(problem.windows) if i % count != fold)
        fit = solve(replace(problem, windows=train), settings=settings)
        unseen = replace(problem, windows=test)
        r = unseen.residuals(fit.values)
        parts.append(np.where(unseen.rows.used & np.isnan(r), np.inf, r))
    return rms(np.concatenate(parts))


def _pooled(error: np.ndarray) -> np.ndarray:
    """One figure per rung: the quadratic mean over outputs of errors relative to the first rung."""
    return np.asarray(np.sqrt(np.nanmean(np.square(error), axis=1)))


def _stand(column: np.ndarray, gain: float, patience: int) -> int:
    """The rung that one output alone would stand on."""
    chosen, misses = 0, 0
    for number in range(1, len(column)):
        if column[number] < (1.0 - gain) * column[chosen]:
            chosen, misses = number, 0
        else:
            misses += 1
        if misses >= patience:
            break
    return chosen
