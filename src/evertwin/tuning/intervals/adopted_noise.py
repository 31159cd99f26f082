"""What the noise of measurements does to numbers, by way of the predictions that begin with it.

A prediction begins with what was measured, so the noise of one row acts in all rows up to the next
start, and in all outputs at once: a speed that is taken too high moves the position too. What the
autocorrelation of each output's residual tells is less than that, for it knows no other output. So
each start's noise is followed through the model: with S the change of the predictions with it, the
score errs by JᵀS of the rows that it leads to, less what the same noise does in its own row, where
it is a residual (the middle of the sandwich of H. White, Econometrica 50, 1982, from the model).

>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> rows = make_block(t=np.arange(5) * 10**9, u=np.ones((5, 1)), y=np.arange(5.0)[:, None])
>>> adopted(Problem(Robot1D(), (rows,), ("gain",), horizon=2.0), 0).tolist()
[True, False, False, True, False]
"""

from __future__ import annotations

import numpy as np

from evertwin.models.kernels.kernel import ADOPT, ANEW
from evertwin.tuning.intervals.noisy_starts import white
from evertwin.tuning.linear.closed import dense
from evertwin.tuning.linear.sensitivity import Sensitivity
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Bools, Float64, PerOutput, Vector


def adopted(problem: Problem, k: int) -> Bools:
    """Rows from which on predictions begin with another measurement of output ``k``, (n,)."""
    code, y = problem.restart.code, problem.restart.y[:, k]
    return np.asarray((code == ANEW) | ((code == ADOPT) & np.isfinite(np.roll(y, 1))))


def by_noise(
    problem: Problem, values: Vector, acting: Sensitivity, sigma: PerOutput,
    inverse: Float64[np.ndarray, "k k"],
) -> Vector:  # fmt: skip
    """Variance of each parameter by the white noise of the measurements alone, (k,); 0 where the
    rows do not tell how large it is.

    Args:
        values: where the search ended, (k,).
        acting: sensitivity there.
        sigma: noise of each output's residual, by which rows are weighed, (ny,).
        inverse: of the information.
    """
    used, code = acting.used, problem.restart.code
    noise = white(problem.residuals(values), (code == 0) & used.any(axis=1))
    if problem.loss != "linear" or not noise.any():
        return np.zeros(len(values))
    columns = np.where(used[:, :, None], dense(acting.columns, acting.at, len(values)), 0.0)
    columns /= (sigma * sigma)[:, None]
    own = columns @ inverse * noise[:, None]  # (n, ny, k): what a row's noise moves in its own row
    total = np.zeros(len(values))
    for k, (change,) in enumerate(problem.by_starts([values], noise)):
        pull = np.where(used & np.isfinite(change), change, 0.0)
        opens = np.flatnonzero(adopted(problem, k))
        sides = np.add.reduceat(np.einsum("iok,io->ik", columns, pull), opens, axis=0) @ inverse
        apart = own[:, k].copy()
        before = code[opens] == ADOPT
        sides[before] -= apart[opens[before] - 1]
        apart[opens[before] - 1] = 0.0
        total += np.square(sides).sum(axis=0) + np.square(apart).sum(axis=0)
    return total
