"""Remaining useful life: a distribution, never a bare number.

`Life` holds the quantiles of the time that remains until the indicator passes its limit. A quantile
may be infinite (the limit may never be passed), it is never negative and never NaN. Where the data
say nothing yet the answer is `NotEnough`, with what would be enough.

>>> life = Life.of("h", LEVELS, 100.0 * LEVELS)
>>> life.median, life.interval80
(50.0, (10.0, 90.0))
>>> round(life.probability_before(25.0), 3)
0.25

Where wear goes with the work done (cycles, load hours), an indicator carries its ``usage``, its law
runs on that clock, and so does the life that is predicted. A workload says how much work is planned
until when; through it the life becomes a time.

>>> plan = Workload(np.array([0.0, 100.0]), np.array([0.0, 50.0]))
>>> plan.time_of(np.array([25.0, 100.0]))
array([ 50., 200.])
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from evertwin.errors import UsageError
from evertwin.prognosis.laws.series.calendar import Calendar
from evertwin.prognosis.laws.series.indicator import Indicator
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


LEVELS: Float64[np.ndarray, " k"] = np.round(
    np.concatenate([[0.001, 0.0025], np.arange(1, 200) / 200.0, [0.9975, 0.999]]), 6
)
"""Probabilities at which a life keeps its quantiles."""


@dataclass(frozen=True)
class Onset:
    """The warning that wear has begun.

    >>> Onset(120.0, 131.0).begin
    120.0
    """

    begin: float
    """When wear began, as estimated, on the indicator's clock."""
    told: float
    """When it could be told."""


@dataclass(frozen=True)
class NotEnough:
    """The data do not say how long the component will last.

    >>> NotEnough("at least 6 values").verdict
    'not enough data'
    """

    needs: str
    """What would be enough, in words."""
    reason: str = ""
    onset: Onset | None = None
    laws: Mapping[str, float] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """The word of the JSON document."""
        return "not enough data"

    def document(self) -> dict[str, object]:
        """The part ``life`` of ``evertwin.life/1``."""
        return {"verdict": self.verdict, "needs": self.needs}


@dataclass(frozen=True)
class Life:
    """Quantiles of the remaining life. Build with `Life.of`.

    >>> Life.of("h", [0.1, 0.9], [4.0, 8.0]).quantile(0.5)
    6.0
    """

    unit: str
    remaining: Float64[np.ndarray, " k"]
    """Time from now at `LEVELS`: ≥ 0, not falling, may end in infinity."""
    now: float = 0.0
    """The moment of the prediction on the indicator's clock."""
    laws: Mapping[str, float] = field(default_factory=dict)
    """Weight of each law."""
    onset: Onset | None = None
    passed: float | None = None
    """When the limit was passed, on the indicator's clock; None: not yet."""
    failed: bool = False
    """Whether it ended by what was said then, not by its limit."""
    calendar: Calendar | None = None
    """Where that clock counts from 1970."""
    pace: float | None = None
    """How much slower it wears than its like machines, as a factor of time; None: told alone."""
    other: float = 0.0
    """Chance that it wears in another form than they do; by so much it is told alone."""
    by_age: Float64[np.ndarray, " k"] | None = None
    """What lives of its like machines last beyond its age, as long as its own growth does not stand
    out; None: it does, or told alone."""
    worn: Float64[np.ndarray, " k"] | None = None
    """What wear alone leaves, without ends that nothing foretells; None: none are in it."""

    @classmethod
    def of(
        cls, unit: str, levels: Sequence[float] | np.ndarray,
        remaining: Sequence[float] | np.ndarray, now: float = 0.0,
    ) -> Life:  # fmt: skip
        """From quantiles at any levels; linear between them, held beyond the outermost."""
        p, r = np.asarray(levels, dtype=np.float64), np.asarray(remaining, dtype=np.float64)
        if p.shape != r.shape or len(p) == 0 or np.any(np.isnan(r)) or np.any(r < 0.0):
            raise UsageError("life: expected quantiles ≥ 0 that are numbers, one per level")
        if np.any(np.diff(p) <= 0.0) or np.any(r[1:] < r[:-1]):
            raise UsageError("life: expected rising levels and quantiles that do not fall")
        return cls(unit, interpolated(LEVELS, p, r), now)

    def through(self, workload: Workload, unit: str) -> Life:
        """The life as a time, where ``remaining`` is work and this much of it is planned."""
        by_age, worn = (
            None if one is None else workload.time_of(one) for one in (self.by_age, self.worn)
        )
        return replace(
            self, unit=unit, remaining=workload.time_of(self.remaining), by_age=by_age, worn=worn
        )

    @property
    def wearing(self) -> Life:
        """The life as wear ends it, which work on it prevents: what ends at once comes to what is
        new as well."""
        return self if self.worn is None else replace(self, remaining=self.worn, worn=None)

    def quantile(self, p: float) -> float:
        """Time within which life ends with probability ``p``; infinite if it may never."""
        return float(interpolated(np.array([p]), LEVELS, self.remaining)[0])

    @property
    def median(self) -> float:
        """As probable before as after."""
        return self.quantile(0.5)

    @property
    def interval80(self) -> tuple[float, float]:
        """Holds the end of life with 80 %."""
        return self.quantile(0.1), self.quantile(0.9)

    @property
    def interval95(self) -> tuple[float, float]:
        """Holds the end of life with 95 %."""
        return self.quantile(0.025), self.quantile(0.975)

    @property
    def not_before(self) -> float:
        """With 95 % life does not end before this time from now."""
        return self.quantile(0.05)

    @property
    def law(self) -> str:
        """The law of most weight; empty if none is known."""
        return max(self.laws, key=lambda name: self.laws[name]) if self.laws else ""

    @property
    def bounded(self) -> bool:
        """Whether the 95 % interval ends."""
        return bool(np.isfinite(self.interval95[1]))

    @property
    def steepness(self) -> float:
        """k ≥ 1: below its first quantile the distribution falls as (time)^k.

        That is how the distribution of a smallest life falls (Weibull); k is taken from the first
        two quantiles: 1 if life may end at any moment, large if it surely lasts for a while.
        """
        r, p = self.remaining[:2], LEVELS[:2]
        if not r[0] > 0.0 or not np.isfinite(r[1]):
            return 1.0
        width = float(np.log(r[1] / r[0]))
        return max(float(np.log(p[1] / p[0])) / width, 1.0) if width > 0.0 else float("inf")

    def probability_before(self, time: float) -> float:
        """Probability that life ends within ``time`` from now."""
        known = np.isfinite(self.remaining)
        r, p = self.remaining[known], LEVELS[known]
        if time < 0.0 or len(r) == 0:
            return 0.0
        if time < r[0]:
            return float(p[0] * (time / r[0]) ** self.steepness)
        return float(p[np.searchsorted(r, time, side="right") - 1]) if time >= r[-1] else float(
            np.interp(time, r, p)
        )  # fmt: skip

    def risk_before(self, time: float) -> float:
        """The same as it is believed: without growth of its own not beyond what its age tells."""
        risk = self.probability_before(time)
        if self.by_age is None:
            return risk
        return min(risk, replace(self, remaining=self.by_age).probability_before(time))

    def dates(self) -> dict[str, object] | None:
        """The same as dates; None where the clock tells none."""
        told = self.calendar
        if told is None:
            return None
        ends = {"interval80": self.interval80, "interval95": self.interval95}
        return {
            "now": told.iso(self.now), "median": told.iso(self.now + self.median),
            **{name: [told.iso(self.now + x) for x in pair] for name, pair in ends.items()},
            "not_before": told.iso(self.now + self.not_before),
            "passed_at": None if self.passed is None else told.iso(self.passed),
            "past": self.gone,
        }  # fmt: skip

    @property
    def gone(self) -> list[str]:
        """Which of its dates, whole intervals, lie before today; none of a life that is over."""
        told = self.calendar
        if told is None or self.passed is not None:
            return []
        last = {
            "not_before": self.not_before, "median": self.median,
            "interval80": self.interval80[1], "interval95": self.interval95[1],
        }  # fmt: skip
        return [name for name, after in last.items() if told.gone(self.now + after)]

    def document(self) -> dict[str, object]:
        """The part ``life`` of ``evertwin.life/1``; infinity is null."""
        return {
            "median": _finite(self.median),
            "interval80": [_finite(x) for x in self.interval80],
            "interval95": [_finite(x) for x in self.interval95],
            "not_before": _finite(self.not_before),
            "unit": self.unit,
            "passed_at": self.passed,
            "failed": self.failed,
            "pace": self.pace,
            "dates": self.dates(),
        }


def first_of(lives: Sequence[Life]) -> Life:
    """Life of a machine that ends with the first of its components, taken as independent.

    Raises `UsageError` if there is none, or if their units differ.

    >>> one = Life.of("h", LEVELS, 100.0 * LEVELS)
    >>> round(first_of([one, one]).median, 1)
    29.3
    """
    units = {life.unit for life in lives}
    if len(units) != 1:
        raise UsageError(f"first_of: expected lives of one unit, got {sorted(units) or 'none'}")
    nodes = np.unique(np.concatenate([life.remaining for life in lives]))
    nodes = nodes[np.isfinite(nodes)]
    survival = np.ones(len(nodes))
    for life in lives:
        survival *= 1.0 - np.array([life.probability_before(x) for x in nodes])
    remaining = quantiles(nodes, 1.0 - survival)
    now, calendar = max(life.now for life in lives), lives[0].calendar
    return Life(lives[0].unit, remaining, now, calendar=calendar)


def quantiles(
    nodes: Float64[np.ndarray, " m"], cdf: Float64[np.ndarray, " m"]
) -> Float64[np.ndarray, " k"]:
    """Quantiles at `LEVELS` of a distribution function on ``nodes``; infinite beyond its last."""
    if len(nodes) == 0:
        return np.full(len(LEVELS), np.inf)
    rising = np.maximum.accumulate(np.clip(cdf, 0.0, 1.0))
    inner = np.interp(LEVELS, rising, nodes)
    return np.maximum.accumulate(np.where(rising[-1] >= LEVELS, np.maximum(inner, 0.0), np.inf))


def interpolated(
    p: Float64[np.ndarray, " n"], levels: Float64[np.ndarray, " k"],
    values: Float64[np.ndarray, " k"],
) -> Float64[np.ndarray, " n"]:  # fmt: skip
    """Linear between levels; infinite as soon as the upper neighbour is."""
    found: Float64[np.ndarray, " n"]
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(p), np.inf)
    found = np.interp(p, levels[known], values[known])
    found[p > levels[known][-1]] = np.inf if not known.all() else values[known][-1]
    return found


def _finite(x: float) -> float | None:
    return x if np.isfinite(x) else None
