"""How the level of a machine rose: what like machines are compared by.

>>> from evertwin.prognosis.laws.series.indicator import Limit
>>> wear = Indicator.of("wear", "mm", Limit(2.0), np.arange(11.0), np.linspace(0.0, 1.0, 11))
>>> found = way_of(wear)
>>> [None if found is None else round(float(x[-1]), 2) for x in (found.level, found.reached)]
[-1.05, 9.5]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.prognosis.laws.growth.onset import LONG, SHORT, medians, without_covariates
from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.prognosis.laws.series.scaled import noise_of, scaled
from evertwin.types import Float64

LEAST = 2
"""Values that tell where a machine is on the way of others."""
RUN_IN = 8.0
"""Standard deviations of independent values by which a baseline lies above the lowest."""
TANGENT = 0.25
"""Share of an age, the newest, that its tangent is drawn over."""


class Way(NamedTuple):
    """How the level of a machine rose, until its end or until now.

    >>> Way(np.array([0.0, 4.0, 5.0]), np.array([-1.0, -0.5, -0.25]), 7.0).tangent
    1.0
    """

    age: Float64[np.ndarray, " n"]
    level: Float64[np.ndarray, " n"]
    """Distance to the limit, below 0; never falls."""
    end: float
    """Its life; NaN while it lasts."""
    late: Float64[np.ndarray, " n"] | None = None
    """How long before it was known each level was reached; None: none was late."""

    @property
    def now(self) -> float:
        """Its age at the last row."""
        return float(self.age[-1])

    @property
    def tangent(self) -> float:
        """Time to the limit if it went on as in the newest `TANGENT` of its age; 0: unknown."""
        first = int(np.searchsorted(self.age, (1.0 - TANGENT) * self.now))
        first = min(first, len(self.age) - 2)
        risen = float(self.level[-1] - self.level[first]) if first >= 0 else 0.0
        if not risen > 0.0:
            return 0.0
        left = max(-float(self.level[-1]), 1e-3 * abs(float(self.level[0])))
        return left / risen * (self.now - float(self.age[first]))

    def row(self, level: float, age: float, about: float) -> int:
        """The row reached nearest to an age of those about a level; else the first beyond it."""
        first = int(np.searchsorted(self.level, level - about))
        last = int(np.searchsorted(self.level, level + about, side="right"))
        if last > first:
            return first + int(np.argmin(np.abs(self.reached_at(slice(first, last)) - age)))
        return min(int(np.searchsorted(self.level, level)), len(self.age) - 1)

    def until(self, age: float) -> Way:
        """What of it was known at an age."""
        known = int(np.searchsorted(self.age, age, side="right"))
        late = None if self.late is None else self.late[:known]
        return Way(self.age[:known], self.level[:known], np.nan, late)

    @property
    def reached(self) -> Float64[np.ndarray, " n"]:
        """Age at which each level was reached."""
        return self.reached_at(slice(None))

    def reached_at(self, rows: slice) -> Float64[np.ndarray, " rows"]:
        """The same of some rows."""
        return self.age[rows] if self.late is None else self.age[rows] - self.late[rows]


def way_of(indicator: Indicator, end: float = np.nan) -> Way | None:
    """How the level rose: medians of the newest values, as the highest one so far; None: too few.

    What lay higher before the lowest level was run-in.

    A median tells the level of the middle of its values. With few of them its width differs from
    machine to machine, and so does how late it is.

    Args:
        indicator: its current life counts, free of covariates.
        end: its life, on the law's clock.
    """
    problem = scaled(indicator, most=0, least=LEAST)
    if isinstance(problem, str):
        return None
    y = (without_covariates(problem) - problem.limit) * problem.scale
    width = int(np.clip(len(y) // 4, 1, SHORT))
    level, age = medians(y, width), problem.s * problem.age
    long = int(np.clip(len(y) // 3, 1, LONG))
    base = medians(y, long)[long - 1 :]
    noise = RUN_IN * noise_of(y) / np.sqrt(long)
    lowest = width - 1  # before it stand medians of fewer values
    if base[0] > base.min() + noise:
        lowest = int(np.argmax(base <= base.min() + noise)) + long // 2
    level[:lowest] = np.minimum(level[:lowest], level[lowest])
    return Way(age, np.maximum.accumulate(level), end, age - medians(age, width))
