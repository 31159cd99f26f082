"""Influences that multiply an indicator: warm-up raises friction by a share, worn or new.

With w the influence (e^(−t/τ) since the start, a temperature difference, a load) the value follows

    y(t) = g(t)·Π (1 + a_i·w_i)         g smooth in time, a_i constant

and wear is in g alone. A quadratic g and the a_i are found by turns, each a linear least-squares
problem; the product is then divided out, down to a reference of w. What the shares leave open is
kept as a covariate. An influence that only adds is a covariate alone.

>>> t = np.arange(40.0)
>>> warm = np.exp(-np.tile([0.0, 3.0], 20))
>>> y = (10.0 + 0.1 * t) * (1.0 + 0.2 * warm)
>>> cold, shares = without_factors(t, y, {"warm": warm}, {"warm": 0.0})
>>> float(np.abs(cold - 10.0 - 0.1 * t).max().round(6)), round(shares["warm"], 6)
(0.0, 0.2)
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evertwin.prognosis.laws.indicator import Indicator
from evertwin.types import Float64

TURNS = 200
LEAST = 8
"""Values that the shares of influences are found from; with fewer nothing is divided out."""
SMALLEST = 0.05
"""A factor never falls below this."""


def without_factors(
    at: Float64[np.ndarray, " n"], value: Float64[np.ndarray, " n"],
    factors: Mapping[str, Float64[np.ndarray, " n"]], reference: Mapping[str, float],
) -> tuple[Float64[np.ndarray, " n"], dict[str, float]]:  # fmt: skip
    """The values as they would be at the reference, and the share of each influence.

    Args:
        at: time of each value.
        value: the values; NaN stays NaN.
        factors: influences by name.
        reference: influence under which values are compared; absent: its median.
    """
    names = list(factors)
    w = np.stack([factors[name] for name in names], axis=1)
    known = np.isfinite(value) & np.isfinite(w).all(axis=1)
    if known.sum() < LEAST + len(names):
        return np.where(known, value, np.nan), {}
    centre = np.array([reference.get(n, float(np.median(factors[n][known]))) for n in names])
    moved = (w - centre)[known]
    span = float(np.ptp(at[known])) or 1.0
    x = (at[known] - at[known][0]) / span
    basis = np.stack([np.ones_like(x), x, x * x], axis=1)
    y, shares = value[known], np.zeros(len(names))
    for _ in range(TURNS):
        factor = np.maximum(np.prod(1.0 + moved * shares, axis=1), SMALLEST)
        level = basis @ np.linalg.lstsq(basis * factor[:, None], y, rcond=None)[0]
        before = shares.copy()
        for k in range(len(names)):
            others = np.prod(1.0 + np.delete(moved * shares, k, axis=1), axis=1) * level
            slope = others * moved[:, k]
            size = float(slope @ slope)
            shares[k] = float(slope @ (y - others)) / size if size > 0.0 else 0.0
        if np.abs(shares - before).max() < 1e-12:
            break
    out = np.full(len(value), np.nan)
    out[known] = y / np.maximum(np.prod(1.0 + moved * shares, axis=1), SMALLEST)
    return out, dict(zip(names, shares.tolist(), strict=True))


def divided(
    indicator: Indicator, factors: Mapping[str, Float64[np.ndarray, " n"]],
    reference: Mapping[str, float],
) -> Indicator:  # fmt: skip
    """The indicator without influences that multiply it.

    Args:
        indicator: the history.
        factors: influences by name, one value for each of the history.
        reference: influence under which the limit holds; absent: its median.

    >>> from evertwin.prognosis.laws.indicator import Limit
    >>> warm = np.tile([1.0, 0.0], 10)
    >>> raw = Indicator.of("f", "Nm", Limit(20.0), np.arange(20), 10.0 * (1.0 + 0.2 * warm))
    >>> divided(raw, {"warm": warm}, {"warm": 0.0}).value.round(6).tolist()[:3]
    [10.0, 10.0, 10.0]
    """
    if not factors:
        return indicator
    value, _ = without_factors(indicator.at, indicator.value, factors, reference)
    return indicator.with_(
        value=value, covariates={**indicator.covariates, **factors},
        reference={**indicator.reference, **reference},
    )  # fmt: skip
