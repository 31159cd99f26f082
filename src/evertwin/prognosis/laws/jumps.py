"""The gamma process: wear that only grows, in jumps of all sizes.

With age s (now = 1) the growth over Δs is Gamma(α·Δs, β). Given α the rate β is conjugate. The
prior of the life, p(T) = 1/T² beyond now, is p(β) = (α/D)·β⁻² with D the distance at the start, so

    β | data ~ Gamma(α − 1, X),       X: the growth so far
    P(growth over r ≥ d) = 1 − I_{d/(d + X)}(α·r, α − 1)

with I the regularised incomplete beta function. A value below the one before has probability 0.
Source: van Noortwijk, "A survey of the application of gamma processes in maintenance" (2009).
"""

from __future__ import annotations

import numpy as np
import scipy

from evertwin.types import Float64

ALPHAS: Float64[np.ndarray, " a"] = np.exp(np.linspace(np.log(2.0), np.log(2e5), 64))
"""Nodes of the shape α over the observed age."""


def evidence(
    y: Float64[np.ndarray, " n"], s: Float64[np.ndarray, " n"], distance: float
) -> Float64[np.ndarray, " a"]:
    """log p(y) per node of `ALPHAS`, prior included; −∞ where the series falls.

    Args:
        y: values, growing towards the limit.
        s: their ages, now = 1.
        distance: from the first value to the limit.
    """
    steps, grown = np.diff(s), np.diff(y)
    moved = steps > 0.0
    out = np.full(len(ALPHAS), -np.inf)
    if distance <= 0.0 or not moved.any() or np.any(grown[moved] <= 0.0) or np.any(grown < 0.0):
        return out
    steps, grown = steps[moved], grown[moved]
    span, total = steps.sum(), grown.sum()
    shape = ALPHAS[:, None] * steps
    whole = ALPHAS * span
    usable = whole > 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        value = (
            np.sum((shape - 1.0) * np.log(grown) - scipy.special.gammaln(shape), axis=1)
            + np.log(ALPHAS / distance)
            + scipy.special.gammaln(whole - 1.0)
            - (whole - 1.0) * np.log(total)
            - np.log(len(ALPHAS))
        )
    out[usable] = value[usable]
    return out


def passed(
    alpha: Float64[np.ndarray, " h"], grown: float, span: float, distance: float,
    r: Float64[np.ndarray, " m"],
) -> Float64[np.ndarray, "h m"]:  # fmt: skip
    """P(passed within ``r``) for some nodes.

    Args:
        alpha: shapes over an age of 1.
        grown: growth so far.
        span: age over which it grew.
        distance: from now to the limit.
        r: times from now, in ages.
    """
    if distance <= 0.0:
        return np.ones((len(alpha), len(r)))
    share = distance / (distance + grown)
    shape = alpha[:, None] * r
    rest = np.broadcast_to((alpha * span - 1.0)[:, None], shape.shape)
    found = 1.0 - scipy.special.betainc(np.maximum(shape, 1e-12), rest, share)
    return np.where(shape > 0.0, found, 0.0)
