"""How good predictions of life are, once the truth is known.

Accuracy is counted per moment of the life (α-λ, relative accuracy), per machine (prognostic
horizon) and over the whole distribution (coverage, CRPS), always beside a dummy that knows only the
mean life.

>>> life = Life.of("h", LEVELS, 100.0 * LEVELS)
>>> within(life, 55.0, 0.2), round(relative_accuracy(life.median, 40.0), 2)
(True, 0.75)
>>> round(crps(life, 50.0), 1)
8.3

Source: Saxena, Celaya, Saha, Saha, Goebel, "Metrics for offline evaluation of prognostic
performance" (2010); Gneiting and Raftery, "Strictly proper scoring rules" (2007).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evertwin.prognosis.laws.series.life import LEVELS, Life
from evertwin.types import Float64

__all__ = ["covers", "crps", "dummy", "horizon", "relative_accuracy", "within"]

ALPHA = 0.2


def within(life: Life | float, truth: float, alpha: float = ALPHA) -> bool:
    """α-λ: whether the median lies within ``alpha`` of the true remaining life."""
    median = life.median if isinstance(life, Life) else life
    return bool(abs(median - truth) <= alpha * truth)


def relative_accuracy(median: float, truth: float) -> float:
    """1 − |error|/truth; −∞ where the median is infinite."""
    return 1.0 - abs(median - truth) / truth if truth > 0.0 else float(median == 0.0)


def covers(interval: tuple[float, float], truth: float) -> bool:
    """Whether the interval holds the truth."""
    return bool(interval[0] <= truth <= interval[1])


def crps(life: Life, truth: float) -> float:
    """Continuous ranked probability score, in the life's unit: twice the mean pinball loss.

    Infinite quantiles count like the last finite one.
    """
    known = np.isfinite(life.remaining)
    if not known.any():
        return float("inf")
    r: Float64[np.ndarray, " k"] = np.where(known, life.remaining, life.remaining[known][-1])
    loss = np.where(truth >= r, LEVELS * (truth - r), (1.0 - LEVELS) * (r - truth))
    return float(2.0 * np.trapezoid(loss, LEVELS))


def horizon(
    at: Sequence[float], medians: Sequence[float], end: float, alpha: float = ALPHA
) -> float:
    """Prognostic horizon: time before ``end`` from which predictions stay within ± alpha·end.

    Args:
        at: ages of the predictions, rising.
        medians: predicted remaining lives; infinite where none was given.
        end: age at which life ended.
        alpha: half-width in whole lives.

    >>> horizon([50.0, 70.0, 90.0], [90.0, 35.0, 12.0], 100.0)
    30.0
    """
    good = [abs(t + r - end) <= alpha * end for t, r in zip(at, medians, strict=True)]
    first = len(good)
    while first > 0 and good[first - 1]:
        first -= 1
    return float(end - at[first]) if first < len(good) else 0.0


def dummy(mean_life: float, age: float) -> float:
    """The remaining life that follows from the mean life alone; never negative.

    >>> dummy(100.0, 130.0)
    0.0
    """
    return max(mean_life - age, 0.0)
