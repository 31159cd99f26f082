"""Does one signal follow another at all? A rate and the level that it should move.

The correlation of the rate with the level's own, at the best lag, is compared with what chance
gives two signals that have nothing to do with each other: its standard error is
√(Σ r_aa(k)·r_bb(k) / n) with the autocorrelations of both (Bartlett, 1935), so that a slow motion,
of which a recording shows few, proves little.

>>> t = np.arange(0.0, 100.0, 0.1)
>>> turn = np.sin(t) + np.sin(2.7 * t)
>>> follows(t, turn, t + 0.3, np.cumsum(turn) * 0.1).clear
True
>>> follows(t, turn, t, np.cos(1.9 * t)).clear
False
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from evertwin.signals.delay import First, Second
from evertwin.types import Vector

CLEAR = 0.5
"""Correlation from which one follows the other, where chance does not reach it."""
ALIKE = 0.95
"""Correlation from which one follows the other though both only go on as before: a period that
another has by chance is not so alike."""
SIGMAS = 4.0
"""Standard errors that chance does not reach at any lag."""
LONGEST = 2.0
"""Lags that are looked at [s]."""
SPANS = (1, 4, 16)
"""Rows that rates are taken over; what is told surest counts."""
FEWEST = 40
"""Rows of the shortest comparison."""


class Follows(NamedTuple):
    """How well a level's rate follows another.

    >>> Follows(0.9, 0.2).clear, Follows(0.2, 0.3).unrelated, Follows(0.2, 0.9).unrelated
    (True, True, False)
    """

    correlation: float
    """At the best lag, its sign left out; 0 where there is nothing to compare."""
    chance: float
    """What chance reaches; infinite where there is nothing to compare."""

    @property
    def clear(self) -> bool:
        """Does it follow?"""
        return self.correlation > min(ALIKE, max(CLEAR, self.chance))

    @property
    def unrelated(self) -> bool:
        """Would it be seen, and is not?"""
        return self.chance < CLEAR and not self.clear


def follows(ta: First, rate: First, tb: Second, level: Second, longest: float = LONGEST) -> Follows:
    """Does ``level``, once it is differentiated, follow ``rate``?

    Args:
        ta: stamps of the rate [s], increasing, (n,).
        rate: held until the next one, (n,); NaN where absent.
        tb: stamps of the level [s], increasing, (m,).
        level: unwrapped where it is an angle, (m,); NaN where absent.
        longest: lags from −longest to +longest are looked at [s].
    """
    known_a, known_b = np.isfinite(ta) & np.isfinite(rate), np.isfinite(tb) & np.isfinite(level)
    ta, rate, tb, level = ta[known_a], rate[known_a], tb[known_b], level[known_b]
    best = Follows(0.0, np.inf)
    if min(len(ta), len(tb)) < FEWEST:
        return best
    period = float(max(np.median(np.diff(ta)), np.median(np.diff(tb))))
    grid = np.arange(max(ta[0], tb[0]), min(ta[-1], tb[-1]), period) if period > 0 else ta[:0]
    if len(grid) < FEWEST:
        return best
    held = np.concatenate([[0.0], np.cumsum(rate[:-1] * np.diff(ta))])
    levels = np.interp(grid, ta, held), np.interp(grid, tb, level)
    for span in (span for span in SPANS if FEWEST * span <= len(grid)):
        a, b = (side[span:] - side[:-span] for side in levels)
        found = _compared(a, b, longest / period)
        if found.correlation - found.chance > best.correlation - best.chance:
            best = found
    return best


def _compared(a: Vector, b: Vector, reach: float) -> Follows:
    a, b, n = a - a.mean(), b - b.mean(), len(a)
    size = float(np.sqrt((a @ a) * (b @ b)))
    if not size > 0.0:
        return Follows(0.0, np.inf)
    lags = np.arange(1 - n, n)
    cross = scipy.signal.correlate(b, a, method="fft") / size
    own = [scipy.signal.correlate(s, s, method="fft") / float(s @ s) for s in (a, b)]
    near = np.abs(lags) <= n // 4
    chance = SIGMAS * float(np.sqrt(max(np.sum(own[0][near] * own[1][near]), 1.0) / n))
    return Follows(float(np.abs(cross[np.abs(lags) <= reach]).max()), chance)
