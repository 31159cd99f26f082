"""Two clocks in one table: how far the second is from the first, and whether it runs apart.

A logger that writes the device's stamp beside its own, or a message with a header stamp that was
logged later, tells both times of every row. Their difference over the first clock is a line: its
height is the offset, its slope the drift, and the scatter about it what the transport adds.

>>> line = Line()
>>> t = np.arange(1000) * 10**7
>>> line.add(t, t + 2 * 10**8 + t // 10**4)
>>> found = line.result("device [s]")
>>> round(found.offset, 3), round(found.drift * 1e6), found.rows
(0.2, 100, 1000)
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.description import ClockInfo
from evertwin.sources.stamps import NO_STAMP, to_ns
from evertwin.sources.table import Column, Table
from evertwin.sources.time_unit import NAMES, guess
from evertwin.types import Int64, Stamps


@dataclass
class Line:
    """Least squares of (second − first) over the first clock, from sums; times from the first row.

    >>> Line().rows
    0
    """

    rows: int = 0
    origin: tuple[int, int] = (0, 0)
    sums: list[float] = field(default_factory=lambda: [0.0] * 5)
    steps: int = 0
    forward: int = 0

    def add(self, first: Stamps, second: Int64[np.ndarray, " n"]) -> None:
        """More rows: stamps of both clocks [ns]."""
        if len(first) == 0:
            return
        if self.rows == 0:
            self.origin = (int(first[0]), int(second[0]) - int(first[0]))
        x = (first - self.origin[0]) * 1e-9
        y = (second - first - self.origin[1]) * 1e-9
        more = (x.sum(), y.sum(), (x * x).sum(), (x * y).sum(), (y * y).sum())
        self.sums = [a + float(b) for a, b in zip(self.sums, more, strict=True)]
        self.rows += len(x)
        self.steps += len(x) - 1
        self.forward += int((np.diff(second) > 0).sum())

    def result(self, column: str) -> ClockInfo | None:
        """Offset in the middle, drift and scatter; None where it is no clock, or too few rows."""
        sx, sy, sxx, sxy, syy = self.sums
        n = self.rows
        wide = sxx - sx * sx / n if n else 0.0
        if n < 3 or wide <= 0 or self.forward < 0.5 * self.steps:
            return None
        drift = (sxy - sx * sy / n) / wide
        left = max(syy - sy * sy / n - drift * drift * wide, 0.0)
        jitter = float(np.sqrt(left / (n - 2)))
        offset = self.origin[1] * 1e-9 + sy / n
        return ClockInfo(column, offset, drift, jitter / float(np.sqrt(wide)), jitter, n)


def other_clocks(table: Table, first: Column) -> tuple[ClockInfo, ...]:
    """Every further column of time, compared with the first, in one more pass over the table."""
    found = []
    for column in table.columns:
        if column != first and _tells_time(column):
            line = _line(table, first, column)
            info = None if line is None else line.result(column.name)
            # A clock that runs twice as fast as the other is a counter or another unit.
            if info is not None and abs(info.drift) < 0.1:
                found.append(info)
    return tuple(found)


def _tells_time(column: Column) -> bool:
    words = [w for w in re.split(r"[^a-z]+", column.name.lower()) if w]
    named = bool(words) and (words[0] in NAMES or any(w in NAMES[1:] for w in words))
    return column.kind == "time" or (column.kind == "number" and named)


def _line(table: Table, first: Column, second: Column) -> Line | None:
    """Both columns, piece by piece."""
    line, units = Line(), None
    passes = (table.rows([], column.name, strict=False) for column in (first, second))
    for pair in zip(*passes, strict=True):
        raw = [rows.time for rows in pair]
        if len(raw[0]) != len(raw[1]):
            return None
        if len(raw[0]) == 0:
            continue
        units = units or [
            guess(column.name, one[:1000], column.unit).unit
            for column, one in zip((first, second), raw, strict=True)
        ]
        try:
            stamps = [to_ns(one, unit) for one, unit in zip(raw, units, strict=True)]
        except DataError:
            return None
        known = (stamps[0] != NO_STAMP) & (stamps[1] != NO_STAMP)
        line.add(stamps[0][known], stamps[1][known])
    return line
