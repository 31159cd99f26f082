"""What a life told alone is worth: measured on wear that no law here is like.

The laws are sure of themselves where one of them fits, and the next load, crack or plateau is in
none of them. So they are asked of the newest `NEWEST` of the values, which say how wear goes now,
and what they say is corrected by how drawn wear that follows none of them went on (`LOW`, `HALF`,
`HIGH`): from

* *own*: the standard deviation of the logarithm of the life that they give;
* *young*: the logarithm of that life over the age. A component is looked at somewhere in its life:
  a life far beyond its age is doubted, and the more the less sure they are;
* *rush*: how much sooner the limit comes at the fastest pace that a median rose by within the
  newest `LATEST`, beyond what noise does.

The upper end reaches at least to where growth comes that slows down further as it did: by the power
of its age that leads through the levels when it began, at half of its age and now; not where it
rushes. The newest values alone do not show how much faster it was.

The median is where the loss in whole lives is least; that of a straight line stays. Ten drawn
lives in a hundred end before the lower end, and eight after the upper one.

What ends at once is foretold by nothing. Of such ends, at a moment of life that is no special one,
one in ten comes within a ninth of the age (Gott, "Implications of the Copernican principle for our
future prospects", 1993): so `or_at_once`. Narrow answers are earned with a fleet.

>>> told = 50.0 * np.exp(0.01 * (LEVELS - 0.5))
>>> sure, slowing = widened(told, Pace(4.0, np.inf)), widened(told, Pace(4.0, np.inf, 5.5))
>>> [[round(float(np.interp(p, LEVELS, one))) for p in (0.1, 0.5, 0.9)] for one in sure]
[[6, 50, 73], [28, 50, 73]]
>>> round(float(np.interp(0.9, LEVELS, slowing[0])))
245
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.prognosis.laws.growth.onset import SHORT, medians, without_covariates
from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.prognosis.laws.series.life import LEVELS, quantiles
from evertwin.prognosis.laws.series.scaled import Problem, noise_of, steady
from evertwin.prognosis.laws.wear.clocks import HUGE
from evertwin.types import Float64, Vector

NEWEST = 0.5
"""Share of the values that the laws are asked of."""
FEWEST = 20
"""Values that are asked at least, where there are as many."""
VACUOUS = 50.0
"""Upper over lower end of the 80 % interval from which it says nothing; by its age alone, a
component may last `SOON` to 1 / `SOON` of it, 81."""
SOON, AT_ONCE = 1.0 / 9.0, 0.1
"""Share of the age within which an end that nothing foretells comes, and with which chance."""
STEPS = 21
LOW = np.array([-0.57, -1.26, -0.04, -0.42, 1.19])
HALF = np.array([0.0, -0.95, 0.0, -0.58, 0.94])
HIGH = np.array([0.35, 0.72, -0.26, 0.0, 0.87])
"""Logarithms of the ends and of the middle of drawn lives over the median of the laws: a constant,
and what each own, young, own · young and rush adds (`python -m proofs.alone`)."""
SOONEST = 5.0
"""A rush counts up to this logarithm."""
LATEST = 0.125
"""Share of the values in which a rush is looked for."""
CERTAIN = 2.0
"""Standard deviations beyond which a rise is no noise."""
OFTEN = 768
"""Values from which a rise has to stand out more."""
NEXT = 0.003
"""Least share of the way that is left."""
NARROWEST = 0.2
"""Least distance of an end from the median, as a logarithm."""
POWERS = (0.1, 4.0)
"""Powers of its age that growth is followed by to the limit where it slows down."""
HALVES = 4
"""Values of each half that tell how growth slows down, and newest ones that outrun it."""
OUTRUN = 0.5
"""Share of what the newer half grew by from which growth beside its line is a rush."""

_SCORES = scipy.special.ndtri(LEVELS)


class Pace(NamedTuple):
    """How fast a series goes, beside its laws.

    >>> Pace(5.0, np.inf).age
    5.0
    """

    age: float
    """Logarithm of the age."""
    rush: float
    """Logarithm of the time to the limit at the fastest pace lately; infinite: none stands out."""
    slowing: float = -np.inf
    """Logarithm of the time to the limit by the power that it grew by; −∞: not known."""


def newest(indicator: Indicator) -> Indicator:
    """The newest values of the current life, as if it had begun with them."""
    life = indicator.since_replaced()
    good = np.flatnonzero(np.isfinite(life.value))
    count = max(int(NEWEST * len(good)), FEWEST)
    first = int(good[-count]) if count < len(good) else 0
    return replace(life.rows(np.arange(first, len(life.at))), origin=None)


def pace_of(problem: Problem) -> Pace:
    """How fast a series goes."""
    y = without_covariates(problem)
    s = (problem.s - problem.s[0]) / (problem.s[-1] - problem.s[0])
    start = float(np.median(y[: int(np.clip(len(y) // 8, 3, 6))]))
    way = max(problem.limit - start, 1e-12)
    span = problem.age * (problem.s[-1] - problem.s[0])
    since = problem.age * (1.0 - problem.s[-1])  # time since the newest value
    left = max(_rushed(s, (y - start) / way) * span - since, 1e-6 * span)
    age = float(np.log(problem.age))
    return Pace(age, float(np.log(left)), age + _slowing(s, (y - start) / way))


def _slowing(s: Vector, y: Vector) -> float:
    """Logarithm of the time to the limit, 1, in ages, by the power that leads through the levels at
    half of the age and now; −∞ where it did not grow over both, or the newest values outrun it."""
    half = int(np.searchsorted(s, 0.5))
    if min(half, len(y) - half) < HALVES:
        return -np.inf
    (older, end), (newer, now) = (steady(s[k], y[k]) for k in (slice(half), slice(half, None)))
    middle = 0.5 * (end + older * (0.5 - s[half - 1]) + now - newer * (s[-1] - 0.5))
    ahead = float(np.median(y[-HALVES:])) - now - CERTAIN * noise_of(y)
    if ahead > OUTRUN * (now - middle) or not max(middle, 0.0) < now < 1.0:
        return -np.inf
    power = np.log2(now / middle) if middle > 0.0 else POWERS[1]
    longer = min(-np.log(now) / float(np.clip(power, *POWERS)), HUGE)
    return float(np.log(max(np.expm1(longer), 1e-3)))


def _rushed(s: Vector, y: Vector) -> float:
    """Time to the limit, 1, at the fastest pace of the newest values, in ages; infinite: none."""
    width = int(np.clip(len(y) // 4, 3, SHORT))
    first = min(max(int((1.0 - LATEST) * len(y)), width - 1), len(y) - width - 1)
    if first < width - 1:
        return np.inf
    level = medians(y, width)[first:]
    noise = noise_of(y) * np.sqrt(np.pi / width)  # of the difference of two medians
    step = level[width:] - level[:-width]
    # Of many rises some are large by chance: one has to be rare among as many, beyond the usual.
    rare = scipy.special.ndtr(-CERTAIN) * min(OFTEN / len(y), 1.0) ** 8
    rises = step - np.median(step) > -float(scipy.special.ndtri(rare)) * noise
    risen = np.where(rises | (len(y) <= OFTEN), step - CERTAIN * noise, 0.0)
    when = medians(s, width)[first:]
    took = when[width:] - when[:-width]
    if not np.any(risen > 0.0) or not np.median(took) > 0.0:
        return np.inf
    # Values in quick succession tell no pace: over no less than the usual time.
    pace = float(np.max(risen / np.maximum(took, np.median(took))))
    return max(1.0 - float(level[-1]), NEXT) / pace


def known_of(
    remaining: Float64[np.ndarray, " k"], pace: Pace
) -> tuple[float, Float64[np.ndarray, " 5"]] | None:
    """(median of the laws, what `LOW`, `HALF` and `HIGH` weigh); None where they give no end.

    Args:
        remaining: by the laws, at `LEVELS`.
        pace: how fast the series goes.
    """
    low, half, high = (float(np.interp(p, LEVELS, remaining)) for p in (0.1, 0.5, 0.9))
    if not low > 0.0 or not np.isfinite(half):
        return None
    own = np.log(high / low) / 2.5631 if np.isfinite(high) else np.log(half / low) / 1.2816
    own, middle = min(float(own), 2.0), float(np.log(half))
    young, rush = middle - pace.age, max(min(pace.rush - middle, 0.0), -SOONEST)
    return half, np.array([1.0, own, young, own * young, rush])


def widened(
    remaining: Float64[np.ndarray, " k"], pace: Pace
) -> tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, " k"]] | None:
    """Quantiles of the life as it is told; None where they would say nothing.

    Args:
        remaining: by the laws, at `LEVELS`.
        pace: how fast the series goes.
    """
    found = known_of(remaining, pace)
    if found is None:
        return None
    half, known = found
    first, middle, last = LOW @ known, HALF @ known, HIGH @ known
    if pace.rush >= np.log(half):
        last = max(last, pace.slowing - float(np.log(half)))
    below, above = (max(x, NARROWEST) / 1.2816 for x in (middle - first, last - middle))
    told = half * np.exp(middle + np.where(_SCORES < 0.0, below, above) * _SCORES)
    out = or_at_once(told, SOON * float(np.exp(pace.age)))
    low, high = (float(np.interp(p, LEVELS, out)) for p in (0.1, 0.9))
    return (out, told) if high <= VACUOUS * low else None


def or_at_once(told: Float64[np.ndarray, " k"], soon: float) -> Float64[np.ndarray, " k"]:
    """Quantiles of the earlier one of a life and of an end that nothing foretells.

    The median and what lies beyond it stay: they are measured with what ended at once.

    Args:
        told: of the life, at `LEVELS`.
        soon: time within which the other end comes with `AT_ONCE`, evenly.
    """
    nodes = np.union1d(told, np.linspace(0.0, soon, STEPS))
    half = float(np.interp(0.5, LEVELS, told))
    once, at_half = (AT_ONCE * np.minimum(x / soon, 1.0) for x in (nodes, half))
    by_life = np.interp(nodes, told, LEVELS, left=0.0)
    both = 1.0 - (1.0 - (2.0 - 1.0 / (1.0 - at_half)) * by_life) * (1.0 - once)
    return quantiles(nodes, np.where(nodes < half, both, by_life))
