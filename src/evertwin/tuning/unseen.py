"""What a model errs by on windows that it was not tuned on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.tuning.assemble import rms
from evertwin.tuning.problem import Problem
from evertwin.tuning.settings import Settings
from evertwin.tuning.solver import solve
from evertwin.types import Float64


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
