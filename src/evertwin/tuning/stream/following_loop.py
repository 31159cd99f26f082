"""The loop of `evertwin.tuning.stream.following`: plain sums in a fixed order, so that the bits
do not depend on where the rows are cut.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.tuning.stream.recursive_loop import inform

OUTSIDE = 8.0
"""Residual, in units of its rms, from which on a row is not learned from."""


@njit(cache=True)
def learn(
    rows: Any, linear: Any, groups: Any, limits: Any, memory: float, prior: Any, state: Any
) -> None:
    """Rows: what version and estimate are off by; forget; learn what is trusted and moves.

    Args:
        rows: interval, inputs, outputs, marks of the rows.
        linear: y0, regressor, columns, place of each column among what is followed (−1: none).
        groups: group of each output and of each parameter.
        limits: (ny,) input that tells whether an output moves (−1: none), above which size.
        memory: time constant of forgetting [s].
        prior: values (np,) and information (k,).
        state: estimate (np,), weight (ny,), information, vector, noise and losses (ny, 2).
    """
    dt, u, y, mark = rows
    y0, phi, columns, at = linear
    of_output, of_parameter = groups
    gate, above = limits
    values, information = prior
    p, weight, matrix, vector, noise, losses = state
    n, ny, m = phi.shape
    nu, k = u.shape[1], vector.shape[0]
    learned = np.zeros(ny, dtype=np.bool_)
    for i in range(n):
        sound = True
        for a in range(nu):
            sound = sound and (mark[i, a] <= 2 or mark[i, a] == 5)
        for o in range(ny):
            moves = gate[o] < 0 or abs(u[i, max(gate[o], 0)]) > above[o]
            measured = mark[i, nu + o] == 0 or mark[i, nu + o] == 5
            learned[o] = sound and moves and measured and math.isfinite(y[i, o] - y0[i, o])
        keep = math.exp(-dt[i] / memory)
        for g in range(ny):
            told = False
            for o in range(ny):
                told = told or (learned[o] and of_output[o] == g)
            if not told or keep >= 1.0:
                continue
            for a in range(k):
                if of_parameter[a] != g:
                    continue
                vector[a] *= keep
                for b in range(k):
                    matrix[a, b] *= keep  # another group's share is 0
                matrix[a, a] += (1.0 - keep) * information[a]
        for o in range(ny):
            if not learned[o]:
                continue
            before = after = y[i, o] - y0[i, o]
            for a in range(m):
                if columns[o, a] >= 0:
                    before -= phi[i, o, a] * values[columns[o, a]]
                    after -= phi[i, o, a] * p[columns[o, a]]
            # one sample far outside moves nothing; many of them widen what is usual
            most = OUTSIDE * OUTSIDE * noise[o, 0] / noise[o, 1] if noise[o, 1] > 0.0 else np.inf
            square = min(after * after, most)
            noise[o, 0] = keep * noise[o, 0] + square
            noise[o, 1] = keep * noise[o, 1] + 1.0
            losses[o, 0] = keep * losses[o, 0] + min(before * before, most)
            losses[o, 1] = keep * losses[o, 1] + square
            if not after * after < most:
                continue
            inform(matrix, vector, phi[i, o], at[o], weight[o], before)
