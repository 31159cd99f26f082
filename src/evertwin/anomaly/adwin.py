"""ADWIN: a window that grows while its mean holds, and drops its old part when it does not.

The window is kept as an exponential histogram: row ``l`` holds up to ``BUCKETS`` buckets of ``2^l``
samples each, as their sum and their sum of squared differences. Every ``clock`` samples all splits
between buckets are tried; the old part goes where the means of the two parts differ by more than

    ε = √(2·m·σ²·ln(2·ln(W)/δ)) + ⅔·m·ln(2·ln(W)/δ),    m = 1/n₀ + 1/n₁

(Bifet and Gavaldà, "Learning from time-changing data with adaptive windowing", 2007). Memory is
logarithmic in the window. Compiled; the state is one array of fixed size, so that it can be saved.

>>> state = new(1)
>>> x = np.r_[np.zeros(1000), np.ones(200)] + np.random.default_rng(0).normal(0, 0.1, 1200)
>>> [i for i, v in enumerate(x) if add(state[0], float(v), 0.002, CLOCK)][:1]
[1023]
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.types import Float64

LEVELS, BUCKETS = 40, 5
CLOCK, GRACE, LEAST = 32, 10, 5
"""Usual samples between two tests; width that they start at; least samples of a part."""
USED, SUM, SQUARE = 0, 1, 2 + BUCKETS
"""Columns of a level: buckets used, their sums, their sums of squares (oldest first)."""
COLUMNS = 3 + 2 * BUCKETS
TICKS, WIDTH, TOTAL, SPREAD = 0, 1, 2, 3
"""Columns of the last line: samples ever, samples, sum and sum of squares of the window."""


def new(count: int) -> Float64[np.ndarray, "count levels columns"]:
    """``count`` empty windows."""
    return np.zeros((count, LEVELS + 1, COLUMNS))


@njit(cache=True)
def _push(level: Any, total: float, square: float) -> None:
    at = int(level[USED])
    level[SUM + at] = total
    level[SQUARE + at] = square
    level[USED] += 1


@njit(cache=True)
def _pop(level: Any, count: int) -> None:
    """Drops the ``count`` oldest buckets of a level."""
    left = int(level[USED]) - count
    for m in range(left):
        level[SUM + m] = level[SUM + m + count]
        level[SQUARE + m] = level[SQUARE + m + count]
    level[USED] = left


@njit(cache=True)
def _merged(n0: float, u0: float, v0: float, n1: float, u1: float, v1: float) -> float:
    """Sum of squared differences of two parts taken together."""
    between = u0 / n0 - u1 / n1
    return v0 + v1 + n0 * n1 / (n0 + n1) * between * between


@njit(cache=True)
def _compress(window: Any) -> None:
    for at in range(LEVELS - 1):
        level = window[at]
        if level[USED] <= BUCKETS:
            return
        n = 2.0**at
        square = _merged(n, level[SUM], level[SQUARE], n, level[SUM + 1], level[SQUARE + 1])
        _push(window[at + 1], level[SUM] + level[SUM + 1], square)
        _pop(level, 2)


@njit(cache=True)
def _differs(
    n0: float, u0: float, n1: float, u1: float, variance: float, confidence: float
) -> bool:
    if n0 < LEAST or n1 < LEAST:
        return False
    m = 1.0 / (n0 - LEAST + 1.0) + 1.0 / (n1 - LEAST + 1.0)
    epsilon = math.sqrt(2.0 * m * variance * confidence) + 2.0 / 3.0 * confidence * m
    return bool(abs(u0 / n0 - u1 / n1) > epsilon)


@njit(cache=True)
def _splits(window: Any, delta: float) -> bool:
    """Is there a split whose parts differ? From the oldest bucket on."""
    all_, n0, u0 = window[LEVELS], 0.0, 0.0
    width, total, variance = all_[WIDTH], all_[TOTAL], all_[SPREAD] / all_[WIDTH]
    confidence = math.log(2.0 * math.log(width) / delta)
    # ε² is above 2·m·σ²·ln(…) and m above 1/n₀ + 1/n₁: most splits are passed over undivided
    least = 1.999 * variance * confidence * width
    for at in range(LEVELS - 1, -1, -1):
        n = 2.0**at
        for m in range(int(window[at, USED])):
            n0 += n
            u0 += window[at, SUM + m]
            n1, u1 = width - n0, total - u0
            between = u0 * n1 - u1 * n0
            if between * between <= least * n0 * n1:
                continue
            if _differs(n0, u0, n1, u1, variance, confidence):
                return True
    return False


@njit(cache=True)
def _forget(window: Any) -> None:
    """Drops the oldest bucket."""
    all_ = window[LEVELS]
    at = LEVELS - 1
    while window[at, USED] == 0:
        at -= 1
    n, u, v = 2.0**at, window[at, SUM], window[at, SQUARE]
    all_[WIDTH] -= n
    all_[TOTAL] -= u
    between = u / n - all_[TOTAL] / all_[WIDTH]
    all_[SPREAD] -= v + n * all_[WIDTH] / (n + all_[WIDTH]) * between * between
    all_[SPREAD] = max(all_[SPREAD], 0.0)
    _pop(window[at], 1)


@njit(cache=True)
def add(window: Any, value: float, delta: float, clock: int) -> bool:
    """One sample into the window; True where the mean has changed. Changes ``window``."""
    all_ = window[LEVELS]
    all_[TICKS] += 1.0
    if all_[WIDTH] > 0.0:
        off = value - all_[TOTAL] / all_[WIDTH]
        all_[SPREAD] += all_[WIDTH] / (all_[WIDTH] + 1.0) * off * off
    all_[WIDTH] += 1.0
    all_[TOTAL] += value
    _push(window[0], value, 0.0)
    _compress(window)
    changed = False
    if int(all_[TICKS]) % clock == 0 and all_[WIDTH] > GRACE:
        while all_[WIDTH] > 2 * LEAST and _splits(window, delta):
            _forget(window)
            changed = True
    return changed
