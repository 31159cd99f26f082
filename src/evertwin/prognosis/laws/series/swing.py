"""A swing about the trend is noise, not wear: the day's, a cycle's, or any that stays bounded.

Asked is how far a value lies from the middle of those `h` rows before and after it, typically
(second differences: no steady wear is in them). Of independent noise that is the same at every lag;
of wear that wanders it grows with the lag for ever; of a swing it grows until half of its period
and no further. Where it has grown beyond chance and then stays the same, over lags `LASTS` times as
long, a mean over a period stands for its values.

>>> from evertwin.prognosis.laws.series.indicator import Limit
>>> t = np.arange(480.0)
>>> y = t / 960.0 + 0.02 * np.sin(2.0 * np.pi * t / 24.0)
>>> without_swing(Indicator.of("wear", "mm", Limit(1.0), t, y)).value.size
20
"""

from __future__ import annotations

import numpy as np

from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.prognosis.laws.series.scaled import apart
from evertwin.types import Float64, Vector

GROWN, CHANCE = 1.2, 4.0
"""Factor by which it grows at least, and by how much more over the root of the values."""
LASTS = 6.0
SAME = 1.2
"""Factor within which typical distances are the same."""
PERIOD = 2.75
"""Lags in a period of the first of those: of a sine that is shorter than its half."""
FINER = 1.1
"""Factor from one lag to the next."""


def without_swing(indicator: Indicator) -> Indicator:
    """The series with means over a period for its values; as it is where nothing swings."""
    life = indicator.since_replaced()
    known = np.flatnonzero(np.isfinite(life.value))
    rows = period_of(life.value[known])
    if not rows:
        return indicator
    known = known[len(known) % rows :]
    edges = np.arange(0, len(known), rows)
    weight = 1.0 / apart(life.value[known])
    total = np.add.reduceat(weight, edges)

    def mean(x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " blocks"]:
        return np.asarray(np.add.reduceat(x[known] * weight, edges) / total)

    begin = float(life.at[0]) if life.origin is None else life.origin
    return life.with_(
        at=mean(life.at), value=mean(life.value), sigma=mean(life.sigma),
        covariates={name: mean(x) for name, x in life.covariates.items()},
        usage=None if life.usage is None else mean(life.usage),
        origin=begin,
    ).seen_at(float(life.at[-1]))  # fmt: skip


def period_of(y: Vector) -> int:
    """Rows of a period, about; 0 where nothing swings, or too few of them were seen."""
    most = len(y) // 4
    if most < 2.0 * LASTS:
        return 0
    lags = np.unique(np.geomspace(1, most, int(np.log(most) / np.log(FINER)) + 1).astype(np.int64))
    far = np.array([_typical(y, int(h)) for h in lags])
    for k in range(1, int(np.searchsorted(lags, most / LASTS, side="right"))):
        if far[k + 1 :].max() <= SAME * far[k]:
            grown = far[k] > (GROWN + CHANCE / np.sqrt(len(y))) * far[0]
            return round(PERIOD * float(lags[k])) if grown else 0
    return 0


def _typical(y: Vector, h: int) -> float:
    return float(np.median(np.abs(y[h:-h] - 0.5 * (y[: -2 * h] + y[2 * h :]))))
