"""The loop of `evertwin.tuning.stream.recursive`. Plain sums in a fixed order: no BLAS product,
so that the bits do not depend on where the rows are cut.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit


@njit(cache=True)
def inform(matrix: Any, vector: Any, phi: Any, at: Any, weight: float, off: float) -> None:
    """Adds what an output of a row tells: its regressor (m,), the place of each column among what
    is learned (−1: none), its weight, and what it is off by."""
    for a in range(phi.shape[0]):
        ia = at[a]
        if ia < 0:
            continue
        vector[ia] += weight * phi[a] * off
        for b in range(phi.shape[0]):
            if at[b] >= 0:
                matrix[ia, at[b]] += weight * phi[a] * phi[b]


@njit(cache=True)
def solve_information(matrix: Any, vector: Any, delta: Any, sigma: Any) -> bool:
    """Λ⁻¹λ into ``delta`` and the square roots of Λ⁻¹'s diagonal into ``sigma``.

    False, and nothing changed, where the scaled matrix is not safely positive definite.
    """
    k = vector.shape[0]
    d, root, inv = np.empty(k), np.zeros((k, k)), np.zeros((k, k))
    for i in range(k):
        if not matrix[i, i] > 0.0:
            return False
        d[i] = math.sqrt(matrix[i, i])
    for i in range(k):
        for j in range(i + 1):
            s = matrix[i, j] / (d[i] * d[j])
            for a in range(j):
                s -= root[i, a] * root[j, a]
            if i == j:
                if not s > 1e-9:
                    return False
                root[i, i] = math.sqrt(s)
            else:
                root[i, j] = s / root[j, j]
    for j in range(k):
        inv[j, j] = 1.0 / root[j, j]
        for i in range(j + 1, k):
            s = 0.0
            for a in range(j, i):
                s -= root[i, a] * inv[a, j]
            inv[i, j] = s / root[i, i]
    for i in range(k):
        delta[i] = 0.0
    for a in range(k):
        # Row a of L⁻¹ gives the a-th whitened coordinate, and spreads it back.
        s = 0.0
        for j in range(a + 1):
            s += inv[a, j] * vector[j] / d[j]
        for j in range(a + 1):
            delta[j] += inv[a, j] * s / d[j]
    for j in range(k):
        s = 0.0
        for a in range(j, k):
            s += inv[a, j] * inv[a, j]
        sigma[j] = math.sqrt(s) / d[j]
    return True


@njit(cache=True)
def learn(first: int, given: Any, linear: Any, fixed: Any, state: Any, rows: Any) -> None:
    """Rows: at a beat renew ``p``; predict; forget; learn what is trusted.

    Args:
        first: number of the first row.
        given: intervals, inputs, outputs and marks of the rows.
        linear: outputs without the parameters, (n, ny), and the regressor, (n, ny, m).
        fixed: `RecursiveSettings`.
        state: `RecursiveState`.
        rows: `RecursiveRows`.
    """
    (dt, u, y, mark), (y0, phi), columns, prior = given, linear, fixed.columns, fixed.prior
    p, matrix, vector, places = state.p, state.matrix, state.vector, fixed.places
    n, ny, m = phi.shape
    k, nu = vector.shape[0], u.shape[1]
    delta = np.empty(k)
    for i in range(n):
        if (first + i) % fixed.every == 0 and solve_information(matrix, vector, delta, state.sigma):
            for j in range(k):
                p[places[j]] = prior[places[j]] + delta[j]
        for j in range(k):
            rows.values[i, j] = p[places[j]]
        keep = math.exp(-dt[i] / fixed.memory)
        if keep < 1.0:
            for a in range(k):
                vector[a] *= keep
                for b in range(k):
                    matrix[a, b] *= keep
                matrix[a, a] += (1.0 - keep) * fixed.information[a]
        for o in range(ny):
            predicted, around = y0[i, o], y[i, o] - y0[i, o]
            for a in range(m):
                if columns[o, a] >= 0:
                    predicted += phi[i, o, a] * p[columns[o, a]]
                    around -= phi[i, o, a] * prior[columns[o, a]]
            trusted = mark[i, nu + o] <= 2 or mark[i, nu + o] == 5
            for a in range(nu):
                trusted = trusted and (mark[i, a] <= 2 or mark[i, a] == 5)
            rows.y[i, o] = predicted
            rows.residual[i, o] = y[i, o] - predicted if trusted else np.nan
            gate = fixed.gate[o]
            moving = gate < 0 or abs(u[i, max(gate, 0)]) > fixed.above[o]
            if not trusted or not moving or not math.isfinite(around):
                continue
            inform(matrix, vector, phi[i, o], fixed.at[o], fixed.weight[o], around)
