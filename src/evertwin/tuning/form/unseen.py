"""What a model errs by on windows that it was not tuned on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.fold import Block
from evertwin.models import Parameters
from evertwin.signals.sizes import rms
from evertwin.tuning.intervals.fit import Fit
from evertwin.tuning.posing.hidden_starts import own_starts
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.posing.recordings import beginning, own_names
from evertwin.tuning.posing.settings import Settings
from evertwin.tuning.solver import solve
from evertwin.types import Float64, Vector


def held_out(problem: Problem, settings: Settings | None = None) -> Float64[np.ndarray, " ny"]:
    """rms residual of each output over windows that were left out of the tuning, (ny,).

    A fold whose tuning diverged counts as infinitely bad.
    """
    count = min(len(problem.windows), 10)
    parts = []
    for fold in range(count):
        test = tuple(w for i, w in enumerate(problem.windows) if i % count == fold)
        train = tuple(w for i, w in enumerate(problem.windows) if i % count != fold)
        fit = solve(on(problem, train), settings=settings)
        unseen = on(problem, test)
        r = unseen.residuals(_values(unseen, fit))
        parts.append(np.where(unseen.rows.used & np.isnan(r), np.inf, r))
    return rms(np.concatenate(parts))


def on(problem: Problem, windows: tuple[Block, ...]) -> Problem:
    """The problem on other windows, each of which begins with numbers of its own."""
    model, own = problem.model, problem.model.parameters.names
    names = own_names(model, [name for name in problem.names if name in own], len(windows))
    if set(own_starts(model, len(problem.windows))) & set(problem.names):
        names = (*names, *own_starts(model, len(windows)))
    prior = problem.prior and Parameters(problem.prior.items[: len(own)])
    return replace(problem, windows=windows, editable=names, prior=prior)


def _values(problem: Problem, fit: Fit) -> Vector:
    """The machine's numbers of the fit; recordings begin as the model does."""
    own = beginning(problem.model, problem.names)
    pairs = zip(problem.names, problem.start.tolist(), strict=True)
    return np.array([old if name in own else fit[name] for name, old in pairs])
