"""Work ahead: life under a plan of loads.

Where wear goes with the work done (cycles, load hours), an indicator carries its ``usage``, its law
runs on that clock, and so does the life that is predicted. A workload says how much work is planned
until when; through it the life becomes a time.

>>> plan = Workload(np.array([0.0, 100.0]), np.array([0.0, 50.0]))
>>> plan.time_of(np.array([25.0, 100.0]))
array([ 50., 200.])
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evertwin.errors import UsageError
from evertwin.prognosis.laws.indicator import Indicator
from evertwin.types import Float64


@dataclass(frozen=True)
class Workload:
    """Work done until each time from now; afterwards it goes on as in the last part.

    Raises `UsageError` unless both start at 0, times rise and work does not fall.

    >>> Workload.steady(2.0).time_of(np.array([10.0]))
    array([5.])
    """

    time: Float64[np.ndarray, " m"]
    work: Float64[np.ndarray, " m"]

    def __post_init__(self) -> None:
        fits = self.time.shape == self.work.shape and self.time.ndim == 1 and len(self.time) >= 2
        if not fits or self.time[0] != 0.0 or self.work[0] != 0.0:
            raise UsageError("workload: expected times and work of one length ≥ 2, both from 0")
        if np.any(np.diff(self.time) <= 0.0) or np.any(np.diff(self.work) < 0.0):
            raise UsageError("workload: expected rising times and work that does not fall")

    @classmethod
    def steady(cls, rate: float) -> Workload:
        """The same work per time for ever; ``rate`` ≥ 0."""
        return cls(np.array([0.0, 1.0]), np.array([0.0, rate]))

    @classmethod
    def phases(cls, begins: Sequence[float], rates: Sequence[float]) -> Workload:
        """Work per time from each of some moments on, the first of them now (0).

        >>> Workload.phases((0.0, 10.0, 15.0), (1.0, 0.0, 2.0)).work.tolist()
        [0.0, 10.0, 10.0, 12.0]
        """
        time = np.array([*begins, begins[-1] + 1.0], dtype=np.float64)
        done = np.array(rates, dtype=np.float64) * np.diff(time)
        return cls(time, np.concatenate([[0.0], np.cumsum(done)]))

    @property
    def rates(self) -> Float64[np.ndarray, " parts"]:
        """Work per time in each part; the last goes on for ever."""
        out: Float64[np.ndarray, " parts"] = np.diff(self.work) / np.diff(self.time)
        return out

    def mean_rate(self, until: float) -> float:
        """Work per time from now until then; of the last part where that is never.

        >>> Workload.phases((0.0, 10.0), (1.0, 3.0)).mean_rate(20.0)
        2.0
        """
        rates = self.rates
        if not np.isfinite(until):
            return float(rates[-1])
        if until <= 0.0:
            return float(rates[0])
        beyond = max(until - float(self.time[-1]), 0.0) * float(rates[-1])
        return (float(np.interp(until, self.time, self.work)) + beyond) / until

    @classmethod
    def as_before(cls, indicator: Indicator) -> Workload:
        """The mean rate of the current life; without usage work is time."""
        life = indicator.since_replaced()
        if life.usage is None or len(life.at) < 2 or life.at[-1] <= life.at[0]:
            return cls.steady(1.0)
        return cls.steady(float((life.usage[-1] - life.usage[0]) / (life.at[-1] - life.at[0])))

    def time_of(self, work: Float64[np.ndarray, " k"]) -> Float64[np.ndarray, " k"]:
        """Time at which so much work is done; infinite where it never is."""
        # Where the work rests, the time is that at which the rest began.
        right = np.clip(np.searchsorted(self.work, work, side="left"), 1, len(self.work) - 1)
        done, time = self.work[right - 1], self.time[right - 1]
        rate = (self.work[right] - done) / (self.time[right] - time)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(work > done, time + (work - done) / rate, time)
        out: Float64[np.ndarray, " k"] = np.where(np.isfinite(work), found, np.inf)
        return out
