"""First passage: the probability that the limit is passed within a time, per hypothesis.

*Path with noise* (q = 0): the level at clock distance r is ``now + b·r``. With the Student
posterior of (now, b) the probability that it lies above the limit is a Student distribution
function.

*Process* (q > 0): a Wiener process with drift b that starts at distance d passes after an inverse
Gaussian time. Averaged over b ~ N(m, v) this is, with σ² = s²·q,

    F(r) = Φ((m·r − d)/√(σ²r + vr²))
         + exp(2md/σ² + 2vd²/σ⁴)·Φ(−(2vdr + σ²(mr + d))/(σ²·√(σ²r + vr²)))

and the level's own uncertainty and that of s² are summed over a few nodes.

Both are conditional on not having passed yet. Sources: Chhikara and Folks, "The Inverse Gaussian
Distribution" (1989); Si, Wang, Hu, Zhou, "Remaining useful life estimation: a Wiener-process-based
degradation model with recursive filter" (2013), for the average over the drift.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy

from evertwin.compiled.functions import njit
from evertwin.prognosis.laws.wear.bank import Posterior
from evertwin.types import Float64

SCALES = 5
"""Nodes over s²."""
SHARP = 0.02
"""Variance of the level now, in that of the process until the limit, that does not count."""
NODES = np.sqrt(3.0) * np.array([-1.0, 0.0, 1.0])
"""Gauss-Hermite nodes over the level now, with their weights."""
SHARES = np.array([1.0, 4.0, 1.0]) / 6.0


def path(
    posterior: Posterior, limit: float, r: Float64[np.ndarray, "h m"]
) -> Float64[np.ndarray, "h m"]:
    """P(passed within clock distance ``r``) of paths with noise."""

    def above(x: np.ndarray) -> np.ndarray:
        mean = posterior.now[:, None] + posterior.growth[:, None] * x - limit
        now, both, slope = (posterior.cov[:, i : i + 1] for i in range(3))
        variance = np.maximum(now + 2.0 * both * x + slope * x * x, 1e-300)
        spread = np.sqrt(variance * (posterior.square / posterior.dof)[:, None])
        found: np.ndarray = scipy.special.stdtr(posterior.dof, mean / spread)
        return found

    already = above(np.zeros((len(r), 1)))
    out: np.ndarray = np.clip((above(r) - already) / np.maximum(1.0 - already, 1e-12), 0.0, 1.0)
    return out


def process(
    posterior: Posterior, q: Float64[np.ndarray, " h"], limit: float, r: Float64[np.ndarray, "h m"]
) -> Float64[np.ndarray, "h m"]:
    """P(passed within clock distance ``r``) of Wiener processes with drift."""
    out = np.zeros_like(r)
    middle = (np.arange(SCALES) + 0.5) / SCALES
    inverse = 1.0 / scipy.special.chdtri(posterior.dof, middle)
    told = limit - posterior.now, posterior.growth, posterior.cov, posterior.square, q
    drifting(told, inverse, r, (NODES, SHARES), out)
    return out


@njit(cache=True)
def drifting(told: tuple[Any, ...], inverse: Any, r: Any, nodes: tuple[Any, Any], out: Any) -> None:
    """Adds up the averages of the module's formula over the nodes, in place.

    Args:
        told: distance d to the limit, growth b, their covariance, the noise's square, and q.
        nodes: as deviates, and their shares.
    """
    (d, b, cov, square, q), (deviates, shares) = told, nodes
    for h in range(r.shape[0]):
        for scale in inverse:
            s2 = square[h] * scale
            sigma2 = max(s2 * q[h], 1e-300)
            spread = math.sqrt(max(s2 * cov[h, 0], 0.0))
            turn = -cov[h, 1] / max(cov[h, 0], 1e-300)
            v = max(s2 * (cov[h, 2] - cov[h, 1] * cov[h, 1] / max(cov[h, 0], 1e-300)), 0.0)
            # Where the level's spread is small beside the process, its mean says it all.
            drifts = max(b[h], 0.1 * d[h])
            sharp = d[h] > 0.0 and spread * spread * drifts < SHARP * sigma2 * d[h]
            total = 1.0 if sharp else 0.0
            for k in range(0 if sharp else len(shares)):
                if d[h] + spread * deviates[k] > 0.0:
                    total += shares[k]
            for k in range(1 if sharp else len(shares)):
                away = 0.0 if sharp else spread * deviates[k]
                distance = d[h] + away
                if total > 0.0 and distance <= 0.0:
                    continue
                share = 1.0 if sharp else shares[k] / (total if total > 0.0 else 1.0)
                m = b[h] + turn * away
                for j in range(r.shape[1]):
                    part = passed(distance, m, v, sigma2, r[h, j]) if total > 0.0 else 1.0
                    out[h, j] += share * part / len(inverse)


@njit(cache=True)
def passed(d: float, m: float, v: float, sigma2: float, r: float) -> float:
    """F(r) of the module, for d > 0."""
    if r <= 0.0:
        return 0.0
    root = math.sqrt(sigma2 * r + v * r * r)
    first = 0.5 * math.erfc(-(m * r - d) / root * 0.7071067811865476)
    power = 2.0 * d / sigma2 * (m + v * d / sigma2)
    second = power + log_normal(-(2.0 * v * d * r / sigma2 + m * r + d) / root)
    return min(first + math.exp(min(second, 0.0)), 1.0)


@njit(cache=True)
def log_normal(x: float) -> float:
    """log Φ(x)."""
    if x > -20.0:
        return math.log(max(0.5 * math.erfc(-x * 0.7071067811865476), 1e-300))
    w = 1.0 / (x * x)
    return -0.5 * x * x - math.log(-x) - 0.9189385332046727 + math.log1p(-w + 3.0 * w * w)
