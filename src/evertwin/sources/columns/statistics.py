"""Statistics of a column and of a clock in one pass, in memory that does not grow with the file.

Counts, sums and extremes are exact. Medians and quantiles come from an even sample of at most 8192
rows: every k-th row is kept, and k doubles when the sample is full.

>>> stats = ColumnStatistics()
>>> stats.add(np.array([1, 2, 3]), np.array([1.0, np.nan, 3.0]))
>>> stats.count, stats.missing, stats.mean
(2, 1, 2.0)
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from evertwin.sources.columns.no_value import no_value
from evertwin.types import Stamps

EXTREMES = 10
Array = np.ndarray


@dataclass
class EvenSample:
    """Every k-th value of a stream.

    >>> sample = EvenSample(4)
    >>> sample.add(np.arange(10.0))
    >>> sample.values.tolist(), sample.every
    ([0.0, 4.0, 8.0], 4)
    """

    size: int = 8192
    every: int = 1
    seen: int = 0
    values: Array = field(default_factory=lambda: np.zeros(0))

    def add(self, new: Array) -> None:
        """The next values, (n,)."""
        first = -self.seen % self.every
        self.values = np.concatenate([self.values, new[first :: self.every]])
        self.seen += len(new)
        while len(self.values) > self.size:
            self.values = self.values[::2]
            self.every *= 2


@dataclass
class ColumnStatistics:
    """One column of numbers.

    >>> ColumnStatistics().count
    0
    """

    count: int = 0
    missing: int = 0
    infinite: int = 0
    total: float = 0.0
    squares: float = 0.0
    origin: float = 0.0
    changes: int = 0
    longest: int = 0
    longest_line: int = 0
    run: int = 0
    run_line: int = 0
    last: float = np.nan
    lows: list[tuple[float, int]] = field(default_factory=list)
    highs: list[tuple[float, int]] = field(default_factory=list)
    sample: EvenSample = field(default_factory=EvenSample)
    none: float | None = None
    """What may stand for no value."""
    nones: int = 0

    def add(self, line: Stamps, v: Array) -> None:
        """The next rows: their lines and values, (n,)."""
        finite = np.isfinite(v)
        self.missing += int(np.isnan(v).sum())
        self.infinite += int(np.isinf(v).sum())
        kept, where = v[finite], line[finite]
        if len(kept) == 0:
            return
        if self.count == 0:
            self.origin = float(np.clip(kept[0], -1e150, 1e150))
        self.count += len(kept)
        centred = np.clip(kept, -1e150, 1e150) - self.origin
        self.total += float(centred.sum())
        self.squares += float((centred * centred).sum())
        self.sample.add(kept)
        self._extremes(where, kept)
        self._runs(where, kept)
        self.none = no_value(kept) if self.none is None else self.none
        self.nones += 0 if self.none is None else int(np.sum(kept == self.none))

    def _extremes(self, line: Stamps, v: Array) -> None:
        few = min(EXTREMES, len(v))
        low = np.argpartition(v, few - 1)[:few]
        high = np.argpartition(-v, few - 1)[:few]
        self.lows = sorted(self.lows + _pairs(v, line, low))[:EXTREMES]
        self.highs = sorted(self.highs + _pairs(v, line, high), reverse=True)[:EXTREMES]

    def _runs(self, line: Stamps, v: Array) -> None:
        """The longest stretch of equal values, across pieces."""
        starts = np.flatnonzero(np.concatenate([[v[0] != self.last], v[1:] != v[:-1]]))
        self.changes += len(starts)
        edges = np.concatenate([[0], starts, [len(v)]])
        lengths = np.diff(edges)
        lengths[0] += self.run
        best = int(np.argmax(lengths))
        if lengths[best] > self.longest:
            self.longest = int(lengths[best])
            self.longest_line = self.run_line if best == 0 else int(line[edges[best]])
        if len(starts):
            self.run, self.run_line = int(lengths[-1]), int(line[starts[-1]])
        else:
            self.run = int(lengths[0])
        self.last = float(v[-1])

    @property
    def mean(self) -> float:
        """Mean of the finite values; NaN without any."""
        return self.origin + self.total / self.count if self.count else float("nan")

    @property
    def std(self) -> float:
        """Standard deviation of the finite values; NaN without any."""
        if not self.count:
            return float("nan")
        variance = self.squares / self.count - (self.total / self.count) ** 2
        return float(np.sqrt(max(variance, 0.0)))

    def absurd(self) -> list[tuple[float, int]]:
        """Extremes more than 20 times the range of the central 98 % away from the median."""
        if self.count < 20:
            return []
        low, middle, high = np.quantile(self.sample.values, [0.01, 0.5, 0.99])
        reach = 20 * (high - low)
        if reach == 0:
            return []
        return [(v, at) for v, at in self.lows[::-1] + self.highs if abs(v - middle) > reach]


def _pairs(v: Array, line: Stamps, at: Array) -> list[tuple[float, int]]:
    return list(zip(v[at].tolist(), line[at].tolist(), strict=True))


@dataclass
class ClockStatistics:
    """The stamps of one table as they stand in the file.

    >>> clock = ClockStatistics()
    >>> clock.add(np.array([1, 2, 3, 4]), np.array([0, 10, 10, 5]))
    >>> clock.repeated, clock.backward
    (1, 1)
    """

    rows: int = 0
    first: int = 0
    last: int = 0
    low: int = 2**63 - 1
    high: int = -(2**63)
    repeated: int = 0
    backward: int = 0
    forward: int = 0
    total: float = 0.0
    squares: float = 0.0
    longest: list[tuple[float, int]] = field(default_factory=list)
    sample: EvenSample = field(default_factory=EvenSample)

    def add(self, line: Stamps, t: Stamps) -> None:
        """The next stamps [ns] and their lines; none of them may be absent."""
        if len(t) == 0:
            return
        known = np.concatenate([[self.last], t]) if self.rows else t
        steps = np.diff(known)
        self.first = self.first if self.rows else int(t[0])
        self.last, self.rows = int(t[-1]), self.rows + len(t)
        self.low, self.high = min(self.low, int(t.min())), max(self.high, int(t.max()))
        self.repeated += int((steps == 0).sum())
        self.backward += int((steps < 0).sum())
        ahead = steps > 0
        seconds = steps[ahead] * 1e-9
        self.forward += len(seconds)
        self.total += float(seconds.sum())
        self.squares += float((seconds * seconds).sum())
        self.sample.add(seconds)
        where = line[len(line) - len(steps) :][ahead]
        few = np.argsort(-seconds, kind="stable")[: 2 * EXTREMES]
        self.longest = sorted(self.longest + _pairs(seconds, where, few), reverse=True)
        self.longest = self.longest[: 2 * EXTREMES]
