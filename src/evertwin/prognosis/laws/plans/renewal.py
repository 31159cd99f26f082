"""What a component costs per time of its use, by the date of its maintenance.

Replacing after a further time T ends this life at T or at the failure, whichever is first. With the
age a so far, the distribution F of the remaining life, the cost c_f of a failure in service and c_m
of maintenance in time, the cost per time of use is

    C(T) = (c_f·F(T) + c_m·(1 − F(T))) / (a + ∫₀ᵀ (1 − F(t)) dt)

the age replacement of Barlow and Hunter (1960), given that the component has lived until a. Too
early wastes life, too late risks the failure; where c_f ≤ c_m running to failure is cheapest.

F is linear between the quantiles that a life keeps, so the least C between two of them has a closed
form: it is found, not searched for on a grid. What may never end is counted as failing at the last
quantile that is known: no plan leans on time that no data have shown.

>>> from evertwin.prognosis.laws.series.life import LEVELS
>>> one = Renewal.of(Life.of("h", LEVELS, 80.0 + 40.0 * LEVELS), 400.0, Cost(10_000.0, 1_000.0))
>>> at, rate = one.best()
>>> 79.0 < at < 90.0, rate < one.to_failure
(True, True)
>>> one.best(Windows(first=10.0, every=50.0))[0]
60.0
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.prognosis.laws.series.life import LEVELS, Life
from evertwin.types import Float64, Vector

TAIL = np.geomspace(1e-6, 1.0, 25)[:-1]
"""Shares of the first quantile's probability at which the tail below it is known."""
APART = 1e-12
"""Least distance of two knots, as a share of the longest life: a jump becomes a steep slope."""
SAME = 1e-9
"""A rate that is lower by less than this share is no gain."""


class Cost(NamedTuple):
    """What a component costs.

    >>> Cost(8000.0, 900.0).failure
    8000.0
    """

    failure: float
    """A failure in service, all that follows from it included."""
    maintenance: float
    """Maintenance in time, without the stop that it may share with others."""


class Windows(NamedTuple):
    """Maintenance is possible ``first`` from now and every ``every`` after it.

    >>> Windows(2.0, 5.0).near(np.array([8.0])), Windows(2.0, 5.0).number(12.0)
    (array([ 7., 12.]), 2)
    """

    first: float
    every: float

    def near(self, times: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " m"]:
        """The windows next to each of some times, rising; none is before the first."""
        k = np.maximum((times - self.first) / self.every, 0.0)
        return np.unique(self.first + self.every * np.concatenate([np.floor(k), np.ceil(k)]))

    def number(self, date: float) -> int | None:
        """Which window a date is, 0 the first one; None: it is none."""
        k = round((date - self.first) / self.every)
        off = abs(self.first + k * self.every - date)
        return k if k >= 0 and off <= 1e-9 * max(self.every, abs(date)) else None


@dataclass(frozen=True)
class Renewal:
    """One life with its costs. Build with `Renewal.of`.

    >>> round(Renewal.of(Life.of("h", LEVELS, 100.0 * LEVELS), 0.0, Cost(1.0, 1.0)).to_failure, 3)
    0.02
    """

    age: float
    cost: Cost
    times: Vector
    """Knots of the distribution, rising from 0."""
    failed: Vector
    """Probability of a failure until each; the last is 1."""
    lived: Vector
    """Mean time in use until each."""
    known: float
    """Probability that it fails at all, as far as the life tells."""

    @classmethod
    def of(cls, life: Life, age: float, cost: Cost) -> Renewal:
        """From a remaining life, its age in the same unit, and its costs.

        Raises:
            UsageError: a negative age or cost, or a life that never ends.
        """
        if not age >= 0.0 or not cost.failure >= 0.0 or not cost.maintenance > 0.0:
            raise UsageError(
                f"expected an age and a failure cost of 0 or more and a maintenance cost above 0, "
                f"got {age:g}, {cost.failure:g}, {cost.maintenance:g}"
            )
        finite = np.isfinite(life.remaining)
        r, p = life.remaining[finite], LEVELS[finite]
        if len(r) == 0:
            raise UsageError("expected a life that may end, got one that never does")
        lower = r[0] * TAIL ** (1.0 / life.steepness) if r[0] > 0.0 else r[:0]
        share = p[0] * TAIL if r[0] > 0.0 else r[:0]
        t = np.concatenate([lower, r, r[-1:]])
        f = np.concatenate([share, p, [1.0]])
        now = t <= 0.0
        t = np.concatenate([[0.0], t[~now]])
        f = np.concatenate([[f[now][-1] if now.any() else 0.0], f[~now]])
        steps = APART * t[-1] * np.arange(len(t))
        t = np.maximum.accumulate(t - steps) + steps
        lived = np.concatenate([[0.0], np.cumsum(np.diff(t) * (2.0 - f[1:] - f[:-1]) / 2.0)])
        return cls(age, cost, t, f, lived, 1.0 if finite.all() else float(p[-1]))

    @property
    def over(self) -> bool:
        """Has life ended already?"""
        return bool(self.failed[0] >= 1.0)

    def failure(self, dates: Vector) -> Vector:
        """Probability that it fails before each date."""
        out: Vector = np.interp(dates, self.times, self.failed)
        return out

    def probability(self, date: float) -> float:
        """The same for one date, infinite too, as far as the life tells."""
        return min(float(self.failure(np.array([date]))[0]), self.known)

    def used(self, dates: Vector) -> Vector:
        """Mean time in use until maintenance at each date, or the failure before it."""
        k = np.clip(np.searchsorted(self.times, dates, side="right") - 1, 0, len(self.times) - 1)
        lasting = 1.0 - 0.5 * (self.failed[k] + self.failure(dates))
        out: Vector = self.age + self.lived[k] + np.maximum(dates - self.times[k], 0.0) * lasting
        return out

    def expected(self, dates: Vector) -> Vector:
        """Mean cost of this life with maintenance at each date."""
        failed = self.failure(dates)
        return self.cost.failure * failed + self.cost.maintenance * (1.0 - failed)

    def rate(self, dates: Vector) -> Vector:
        """Cost per time of use with maintenance at each date; infinite if it was never in use."""
        used = self.used(dates)
        paid = self.expected(dates)
        with np.errstate(over="ignore"):  # next to no use: as if there was none
            out: Vector = np.divide(paid, used, out=np.full(len(used), np.inf), where=used > 0.0)
        return out

    @property
    def to_failure(self) -> float:
        """Cost per time of use without any maintenance in time."""
        used = self.age + float(self.lived[-1])
        return self.cost.failure / used if used > 0.0 else float("inf")

    def best(self, windows: Windows | None = None) -> tuple[float, float]:
        """The date of least cost per time of use, and that cost; infinite: run to failure.

        Args:
            windows: possible dates; None: any time.
        """
        if self.over:
            dates = np.zeros(1) if windows is None else np.array([windows.first])
            return float(dates[0]), float(self.rate(dates)[0])
        dates = np.union1d(self.times, self._turns())
        if windows is not None:
            dates = windows.near(dates)
        rates = self.rate(dates)
        k = int(np.argmin(rates))
        if rates[k] >= self.to_failure * (1.0 - SAME):
            return float("inf"), self.to_failure
        return float(dates[k]), float(rates[k])

    def _turns(self) -> Vector:
        """Where C turns between two knots: the root of its derivative's numerator a + b·x + c·x².

        Between knots F is straight, so the numerator of C is linear and its denominator quadratic.
        """
        width = np.diff(self.times)
        f = np.diff(self.failed) / width
        left = self.times[:-1]
        paid, used = self.expected(left), self.used(left)
        more = (self.cost.failure - self.cost.maintenance) * f
        a = more * used - paid * (1.0 - self.failed[:-1])
        b, c = paid * f, 0.5 * more * f
        inside = (a < 0.0) & (b * b >= 4.0 * a * c) & (b > 0.0)
        root = b[inside] + np.sqrt(b[inside] ** 2 - 4.0 * a[inside] * c[inside])
        x = -2.0 * a[inside] / root
        out: Vector = left[inside] + np.minimum(x, width[inside])
        return out
