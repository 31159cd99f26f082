"""Does growth go on? What has ended, or comes and goes, tells no life.

Asked of the newest `STRETCHES` of the record, in time, not in rows: a line through the medians of
`BLOCKS` even parts of it, whose own scatter holds noise that leans on the values before. Growth has
ended where in one of them

* that line may as well be level, and
* `SURE` standard errors above it is still below `SLOW` of the pace that there was before.

It comes and goes where the level has not risen by `BACK` times what it once rose by and gave back:
wear gives nothing back. A fall at a stop is none (`evertwin.prognosis.laws.growth.onset.stops`).

>>> from evertwin.prognosis.laws.series.indicator import Limit
>>> t = np.arange(300.0)
>>> y = 1.0 - np.exp(-t / 20.0) + 0.02 * np.random.default_rng(0).standard_normal(300)
>>> flat_since(Indicator.of("wear", "mm", Limit(3.0), t, y)) is not None
True
>>> flat_since(Indicator.of("wear", "mm", Limit(3.0), t, 0.003 * t + y)) is None
True
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.prognosis.laws.growth.onset import (
    LONG,
    SHORT,
    known_rows,
    medians,
    stops,
    without_covariates,
)
from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.prognosis.laws.series.scaled import noise_of, scaled
from evertwin.types import Vector

STRETCHES = (2.0 / 3.0, 0.5)
"""Shares of the record, the newest, that are asked."""
BLOCKS, FEW = 8, 5
"""Parts of a stretch, and how many of them have values at least."""
SURE = 2.0
SLOW = 0.1
BACK = 1.25
RETURNED = 0.7
"""Share of a rise that was given back."""


class Line(NamedTuple):
    """A line through a stretch.

    >>> Line(0.1, 0.02, 1.0).slope
    0.1
    """

    slope: float
    error: float
    level: float
    """At its begin."""


class Flat(NamedTuple):
    """Growth that has ended.

    >>> Flat(120.0, 0.1).since
    120.0
    """

    since: float
    rise: float
    """What the level would have had to rise by since, to be told from noise."""


def flat_since(indicator: Indicator) -> Flat | None:
    """Since when growth has ended; None: it goes on, or cannot be told to have ended."""
    found = _levels(indicator)
    if found is None:
        return None
    at, y, scale = found
    span, long = float(np.ptp(at)), int(np.clip(len(y) // 3, 3, LONG))
    base = float(medians(y, long)[long - 1 :].min())
    for share in STRETCHES:
        begin = float(at[-1]) - share * span
        line = _line(at, y, begin)
        if line is None:
            continue
        pace, sure = (line.level - base) / ((1.0 - share) * span), SURE * line.error
        if abs(line.slope) <= sure and line.slope + sure < SLOW * pace:
            return Flat(begin, sure * share * span * scale)
    return None


def comes_and_goes(indicator: Indicator) -> bool:
    """Whether a rise like the one that stands now was given back before."""
    found = _levels(indicator)
    if found is None:
        return False
    at, y, _ = found
    short = int(np.clip(len(y) // 4, 3, SHORT))
    level = medians(y, short)[short - 1 :]
    for k in stops(at, indicator.since_replaced()):
        step = float(np.median(y[k : k + short]) - np.median(y[max(k - short, 0) : k]))
        level[max(k - short // 2, 0) :] -= min(step, 0.0)
    risen = level - np.minimum.accumulate(level)
    highest = np.maximum.accumulate(risen)
    peak = np.maximum.accumulate(np.where(risen == highest, np.arange(len(level)), 0))
    gone = level[peak] - level >= RETURNED * highest
    return bool(np.any(gone & (risen[-1] < BACK * highest)))


def _levels(indicator: Indicator) -> tuple[Vector, Vector, float] | None:
    """(times, values free of covariates and growing towards the limit, their unit)."""
    problem = scaled(indicator, most=0)
    if isinstance(problem, str):
        return None
    life = indicator.since_replaced()
    return life.at[known_rows(life)], without_covariates(problem), problem.scale


def _line(at: Vector, y: Vector, begin: float) -> Line | None:
    """A line through the medians of the parts of the stretch since ``begin``; None: too few."""
    own = at >= begin
    at, y = at[own], y[own]
    part = np.minimum(((at - begin) / (at[-1] - begin) * BLOCKS).astype(np.int64), BLOCKS - 1)
    there = np.unique(part)
    if len(there) < FEW:
        return None
    t = np.array([np.mean(at[part == k]) for k in there])
    level = np.array([np.median(y[part == k]) for k in there])
    off = t - t.mean()
    square = float(off @ off)
    slope = float(off @ level) / square
    rest = level - level.mean() - slope * off
    noise = noise_of(y) * np.sqrt(0.5 * np.pi * len(there) / len(y)) if len(y) > len(there) else 0.0
    scatter = max(float(np.sqrt(rest @ rest / (len(there) - 2))), noise)
    return Line(slope, scatter / np.sqrt(square), float(level.mean() + slope * (begin - t.mean())))
