"""What a life told alone is worth: measured on wear that no law here is like.

The laws are sure of themselves where one of them fits, and the next load, crack or plateau is in
none of them. So they are asked of the newest `NEWEST` of the values, which say how wear goes now,
and what they say is corrected by how drawn wear that follows none of them went on (`LOW`, `HALF`,
`HIGH`): from

* *own*: the standard deviation of the logarithm of the life that they give;
* *lately*, *bend*: how much later the limit comes if the slope goes on changing as from the newest
  half of the values to the newest quarter, or from all of them to the newest half;
* *young*: how much shorter the age is than the life that they give, times *own*. A component is
  looked at somewhere in its life, so a life far beyond its age is doubted as much as it is unsure;
* *rush*: how much sooner the limit comes at the fastest pace that a median rose by within the
  newest `LATEST`, beyond what noise does.

Wear that is calm for most of a life and then ends it soon was drawn with the rest. Six drawn lives
in a hundred end before the lower end, so that sudden ends that were not drawn have room, and ten
after the upper one. Narrow answers are earned with a fleet.

>>> told = widened(50.0 * np.exp(0.01 * (LEVELS - 0.5)), Bend(np.nan, np.nan, 4.0, np.inf))
>>> round(float(np.interp(0.5, LEVELS, told)), 6)
50.0
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.prognosis.laws.indicator import Indicator
from evertwin.prognosis.laws.life import LEVELS
from evertwin.prognosis.laws.onset import SHORT, medians, without_covariates
from evertwin.prognosis.laws.scaled import Problem, noise_of, steady
from evertwin.types import Float64, Vector

NEWEST = 0.5
"""Share of the values that the laws are asked of."""
FEWEST = 20
"""Values that are asked at least, where there are as many."""
VACUOUS = 30.0
"""Upper over lower end of the 80 % interval from which it says nothing."""
LOW = np.array([-1.17, 0.0, 0.42, 0.0, 0.45, 1.48])
HALF = np.array([0.0, 0.0, 0.12, 0.12, 0.45, 1.18])
HIGH = np.array([0.35, 1.05, 0.09, 0.16, 0.92, 1.15])
"""Logarithms of what 6, 50 and 90 % of drawn lives last at most, over the median of the laws: a
constant, and what each own, lately, bend, young and rush adds (`python -m proofs.alone`)."""
FARTHEST, SOONEST = 1.5, 3.0
"""A bend, and a rush, count up to these logarithms."""
LATEST = 0.125
"""Share of the values in which a rush is looked for."""
CERTAIN = 2.0
"""Standard deviations beyond which a rise is no noise."""
NEXT = 0.003
"""Least share of the way that is left."""
NARROWEST = 0.2
"""Least distance of an end from the median, as a logarithm."""

_SCORES = scipy.special.ndtri(LEVELS)


class Bend(NamedTuple):
    """How a series bends.

    >>> Bend(4.0, 4.2, 5.0, np.inf).lately
    4.0
    """

    lately: float
    """Logarithm of the time to the limit, by the newest quarter and half; NaN: unknown."""
    whole: float
    """The same by the newest half and the whole."""
    age: float
    """Logarithm of the age."""
    rush: float
    """Logarithm of the time to the limit at the fastest pace lately; infinite: none stands out."""


def newest(indicator: Indicator) -> Indicator:
    """The newest values of the current life, as if it had begun with them."""
    life = indicator.since_replaced()
    good = np.flatnonzero(np.isfinite(life.value))
    count = max(int(NEWEST * len(good)), FEWEST)
    first = int(good[-count]) if count < len(good) else 0
    return replace(life.rows(np.arange(first, len(life.at))), origin=None)


def bent(problem: Problem) -> Bend:
    """How a series bends."""
    y = without_covariates(problem)
    s = (problem.s - problem.s[0]) / (problem.s[-1] - problem.s[0])
    start = float(np.median(y[: int(np.clip(len(y) // 8, 3, 6))]))
    way = max(problem.limit - start, 1e-12)
    parts = [max(int(share * len(y)), min(len(y), 6)) for share in (1.0, 0.5, 0.25)]
    whole, half, quarter = (steady(s[-n:], (y[-n:] - start) / way) for n in parts)
    span = problem.age * (problem.s[-1] - problem.s[0])
    since = problem.age * (1.0 - problem.s[-1])  # time since the newest value
    bends = _onward(half, quarter, 0.125), _onward(whole, half, 0.25), _rushed(s, (y - start) / way)
    left = np.log(np.maximum(np.array(bends) * span - since, 1e-6 * span))
    return Bend(float(left[0]), float(left[1]), float(np.log(problem.age)), float(left[2]))


def _rushed(s: Vector, y: Vector) -> float:
    """Time to the limit, 1, at the fastest pace of the newest values, in ages; infinite: none."""
    width = int(np.clip(len(y) // 4, 3, SHORT))
    first = min(max(int((1.0 - LATEST) * len(y)), width - 1), len(y) - width - 1)
    if first < width - 1:
        return np.inf
    level = medians(y, width)[first:]
    noise = CERTAIN * noise_of(y) * np.sqrt(np.pi / width)  # of the difference of two medians
    risen = level[width:] - level[:-width] - noise
    took = s[first + width :] - s[first:-width]
    if not np.any(risen > 0.0) or not np.median(took) > 0.0:
        return np.inf
    # Values in quick succession tell no pace: over no less than the usual time.
    pace = float(np.max(risen / np.maximum(took, np.median(took))))
    return max(1.0 - float(level[-1]), NEXT) / pace


def _onward(before: tuple[float, float], after: tuple[float, float], apart: float) -> float:
    """Time to the limit, 1, if the slope goes on changing so, in ages; NaN: unknown.

    Args:
        before: slope and level now by an older stretch.
        after: by a newer one.
        apart: ages between the middles of both.
    """
    if before[0] <= 0.0 or after[0] <= 0.0:
        return np.nan
    rate = float(np.clip(np.log(after[0] / before[0]) / apart, -4.0, 8.0))
    straight = max(1.0 - after[1], NEXT) / after[0]
    if abs(rate) < 1e-3:
        return straight
    return float(np.log1p(max(rate * straight, -0.98)) / rate)


def known_of(
    remaining: Float64[np.ndarray, " k"], bend: Bend
) -> tuple[float, Float64[np.ndarray, " 6"]] | None:
    """(median of the laws, what `LOW`, `HALF` and `HIGH` weigh); None where they give no end.

    Args:
        remaining: by the laws, at `LEVELS`.
        bend: how the series bends.
    """
    low, half, high = (float(np.interp(p, LEVELS, remaining)) for p in (0.1, 0.5, 0.9))
    if not low > 0.0 or not np.isfinite(half):
        return None
    own = np.log(high / low) / 2.5631 if np.isfinite(high) else np.log(half / low) / 1.2816
    bends = np.array(bend[:2]) - np.log(half)
    bends = np.where(np.isfinite(bends), np.clip(bends, -FARTHEST, FARTHEST), 0.0)
    own = min(own, 2.0)
    young, rush = (min(x - float(np.log(half)), 0.0) for x in (bend.age, bend.rush))
    return half, np.array([1.0, own, *bends, own * young, max(rush, -SOONEST)])


def widened(remaining: Float64[np.ndarray, " k"], bend: Bend) -> Float64[np.ndarray, " k"] | None:
    """Quantiles of the life as it is told; None where they would say nothing.

    Args:
        remaining: by the laws, at `LEVELS`.
        bend: how the series bends.
    """
    found = known_of(remaining, bend)
    if found is None:
        return None
    half, known = found
    first, middle, last = LOW @ known, HALF @ known, HIGH @ known
    below, above = (max(x, NARROWEST) / 1.2816 for x in (middle - first, last - middle))
    if 1.2816 * (below + above) > np.log(VACUOUS):
        return None
    return np.asarray(half * np.exp(middle + np.where(_SCORES < 0.0, below, above) * _SCORES))
