"""Limits from false alarms: how long a CUSUM may run, on average, until it cries wolf.

A limit is worth what its average run length (ARL) on calm data is. On calm increments ``e`` with
reference ``k`` the run length grows as

    log ARL ≈ θ·h + c,        E[exp(θ·(e − k))] = 1

(Cramér's equation; Siegmund, "Sequential Analysis", 1985). ``θ`` is solved on the calm residual
itself, whatever its distribution, and lessened by what so many samples do not know of it: the mean
of the exponentials is taken two standard errors larger than it is. ``c`` is counted: the detector
runs over a long stream drawn from the residual in blocks, so that what is left of its dependence
stays in, at limits low enough for many alarms that come from different places of the calm data.

>>> e = np.random.default_rng(0).normal(size=20_000)
>>> limit = limit_for(e, k=1.0, target=86_400.0, rng=np.random.default_rng(1))
>>> 5.0 < limit < 6.0       # 5.3 for normal increments
True
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from evertwin.compiled.functions import njit
from evertwin.types import Vector

MONTH = 30 * 86400.0
"""Seconds."""
STREAM = 1 << 17
"""Samples of the stream that alarms are counted on."""
LEVELS = 40
SURE = 2.0
"""Standard errors by which θ is lessened."""
STEEPEST = 50.0
"""Largest θ: increments that never exceed k would give infinity."""


def run_length(per_month: float, interval: float, streams: int) -> float:
    """Samples from false alarm to false alarm, for each of ``streams`` that share the allowance.

    >>> run_length(per_month=1.0, interval=3.0, streams=1)
    864000.0
    """
    return MONTH / interval * streams / per_month


@njit(cache=True)
def alarms(e: Any, k: float, limits: Any, counts: Any) -> float:
    """Counts the alarms of a two-sided CUSUM at each limit; returns the largest sum of all."""
    worst = up = down = 0.0
    for i in range(e.shape[0]):
        up = max(0.0, up + e[i] - k)
        down = max(0.0, down - e[i] - k)
        worst = max(worst, up, down)
    # all limits at once: one sum has to wait for the one before, sums beside each other do not
    ups, downs = np.zeros_like(limits), np.zeros_like(limits)
    for i in range(e.shape[0]):
        for m in range(limits.shape[0]):
            up = max(0.0, ups[m] + e[i] - k)
            down = max(0.0, downs[m] - e[i] - k)
            over = up > limits[m] or down > limits[m]
            counts[m] += over
            ups[m], downs[m] = 0.0 if over else up, 0.0 if over else down
    return worst


def limit_for(e: Vector, k: float, target: float, rng: np.random.Generator) -> float:
    """The limit whose run length is ``target`` samples, never below what calm data reached.

    ``k`` is lessened by two standard errors of the mean of ``e``, since zero is only estimated.
    """
    k, theta = steepness(e, k)
    reached = float(alarms(e, k, np.zeros(0), np.zeros(0, dtype=np.int64)))
    stream = _drawn(e, rng)
    worst = float(alarms(stream, k, np.zeros(0), np.zeros(0, dtype=np.int64)))
    levels, counts = np.linspace(worst / LEVELS, worst, LEVELS), np.zeros(LEVELS, dtype=np.int64)
    alarms(stream, k, levels, counts)
    lengths = len(stream) / np.maximum(counts, 1)
    near = (lengths > 20) & (lengths < len(e) / 10)
    near = near if near.any() else counts == counts.max()
    c = float(np.median(np.log(lengths[near]) - theta * levels[near]))
    return max((float(np.log(target)) - c) / theta, reached)


def steepness(e: Vector, k: float) -> tuple[float, float]:
    """``k`` lessened by what of the mean is not known, and θ of the steeper side with it."""
    k = max(k - 2.0 * _unsure(e), 0.0)
    return k, min(_cramer(e, k), _cramer(-e, k))


def _cramer(e: Vector, k: float) -> float:
    """The positive root θ of the mean of exp(θ·(e − k)) = 1, that mean at its upper bound."""
    if float(e.max()) <= k:
        return STEEPEST

    def excess(theta: float) -> float:
        exponent = theta * (e - k)
        top = float(exponent.max())
        parts = np.exp(exponent - top)
        return top + float(np.log(parts.mean() + SURE * parts.std() / np.sqrt(len(e))))

    high = 1e-3
    while excess(high) < 0 and high < STEEPEST:
        high *= 1.5
    if high == 1e-3 or high >= STEEPEST:
        return high
    return float(scipy.optimize.brentq(excess, high / 1.5, high))


def _block(e: Vector) -> int:
    return max(1, int(np.sqrt(len(e))))


def _unsure(e: Vector) -> float:
    """Standard error of the mean, from the means of blocks."""
    block = _block(e)
    means = e[: len(e) // block * block].reshape(-1, block).mean(axis=1)
    return float(means.std() / np.sqrt(len(means)))


def _drawn(e: Vector, rng: np.random.Generator) -> Vector:
    block = _block(e)
    starts = rng.integers(0, len(e) - block + 1, -(-STREAM // block))
    picked: Vector = e[(starts[:, None] + np.arange(block)).reshape(-1)]
    return picked
