"""Whitening: what of a residual is new at each sample.

Residuals of real machines remember: their own past predicts part of them, and a limit set for
independent samples is then wrong by orders of magnitude. An autoregression

    z[i] = Σ_j a[j]·z[i − 1 − j] + e[i]

is fitted to calm data (least squares, order by Bayes' information criterion) and the innovation
``e`` is what detectors see.

>>> rng = np.random.default_rng(0)
>>> z = np.zeros(4000)
>>> for i in range(1, 4000): z[i] = 0.8 * z[i - 1] + rng.normal()
>>> a = autoregression(z, orders=4)
>>> a.round(1).tolist(), innovations(z, a).std().round(1)
([0.8, 0.0, 0.0, 0.0], np.float64(1.0))
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from evertwin.types import Float64

Series: TypeAlias = Float64[np.ndarray, " n"]
Coefficients: TypeAlias = Float64[np.ndarray, " orders"]
"""Latest lag first."""


def autoregression(z: Series, orders: int) -> Coefficients:
    """Coefficients, zero beyond the order that was chosen.

    Args:
        z: a calm series with mean zero, more than ``4·orders`` samples.
        orders: the highest order tried.
    """
    if orders == 0:
        return np.zeros(0)
    y, lags = z[orders:], sliding_window_view(z, orders)[:-1, ::-1]
    gram, cross, power = lags.T @ lags, lags.T @ y, float(y @ y)
    best = (len(y) * np.log(power / len(y) + 1e-300), np.zeros(orders))
    for order in range(1, orders + 1):
        a = np.linalg.lstsq(gram[:order, :order], cross[:order], rcond=None)[0]
        spread = max(power - float(a @ cross[:order]), 0.0) / len(y) + 1e-300
        cost = len(y) * np.log(spread) + order * np.log(len(y))
        if cost < best[0]:
            best = (cost, np.append(a, np.zeros(orders - order)))
    return best[1]


def innovations(z: Series, a: Coefficients) -> np.ndarray:
    """``e`` of all samples but the first ``len(a)``, (n − orders,)."""
    if len(a) == 0:
        return z.copy()
    lags = sliding_window_view(z, len(a))[:-1, ::-1]
    e: np.ndarray = z[len(a) :] - np.einsum("ij,j->i", lags, a)
    return e


def effective(z: Series, a: Coefficients) -> float:
    """Independent samples that would fix the mean of ``z`` as well.

    More than ``len(z)`` where neighbours cancel each other. The variance of a long mean is
    ``σe² / (n·(1 − Σa)²)``.
    """
    spread = float(np.var(innovations(z, a)))
    if spread == 0.0:
        return 0.0
    return len(z) * float(np.var(z)) * (1.0 - float(a.sum())) ** 2 / spread
