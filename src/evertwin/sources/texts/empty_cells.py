"""Cells without a value: a logger that drops some, or a channel that is recorded less often.

A channel of a lower rate, or of stamps of its own, has its values at even distances in time; what
lies between is nobody's loss. A distance of twice the usual one is one value lost, if there was a
row for it. What is written only when it changes has few values at all, and nothing is told of it.

>>> import numpy as np
>>> cells = EmptyCells(("force", "pose"))
>>> v = np.ones((200, 2)); v[[3, 7, 40], 0] = np.nan; v[np.arange(200) % 10 > 0, 1] = np.nan
>>> cells.add(np.arange(200) * 10**7, v, np.arange(200) + 2)
>>> cells.found()
[('force', 3, 5)]
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evertwin.types import Int64, Outputs, Stamps, Vector

SELDOM = 0.5
"""Share of empty cells beyond which a channel is not one that each row should have."""


class EmptyCells:
    """Counts of a file, piece by piece. See the module for an example."""

    def __init__(self, channels: Sequence[str]) -> None:
        self._each = [_Channel(name) for name in channels]
        self._rows = 0

    def add(self, t: Stamps, v: Outputs, line: Int64[np.ndarray, " n"]) -> None:
        """Further rows (NaN: no value), their stamps [ns] and their lines."""
        for channel, values in zip(self._each, v.T, strict=True):
            channel.add(t, values, line, self._rows)
        self._rows += len(t)

    def found(self) -> list[tuple[str, int, int]]:
        """Channel, values that are missing, line of the first: of those that lost any."""
        told = ((one, one.missing(self._rows)) for one in self._each)
        return [(one.name, count, one.line) for one, count in told if count]


class _Channel:
    """Empty cells of one channel, and the distance between its values."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.line = 0
        self._empty = self._lost = 0
        self._usual = 0.0
        self._begun = 0
        """Stamp of the first row, [ns]."""
        self._end = 0
        self._first = (0, 0)
        """Row and stamp of the first value."""
        self._last: tuple[int, int] | None = None
        """The same of the newest."""

    def add(self, t: Stamps, values: Vector, line: Int64[np.ndarray, " n"], row: int) -> None:
        self._begun = self._begun if row else int(t[0])
        self._end = int(t[-1])
        there = np.flatnonzero(~np.isnan(values))
        if len(there) < len(values):
            self.line = self.line or int(line[int(np.argmax(np.isnan(values)))])
            self._empty += len(values) - len(there)
        if not len(there):
            return
        rows, stamps = there + row, t[there]
        if self._last is None:
            self._first = int(rows[0]), int(stamps[0])
        else:
            rows, stamps = np.append(self._last[0], rows), np.append(self._last[1], stamps)
        steps = np.diff(stamps)
        if len(steps):
            self._usual = self._usual or float(np.quantile(steps, 0.25))
            wanted = np.rint(steps / max(self._usual, 1.0)) - 1.0
            self._lost += int(np.minimum(np.diff(rows) - 1, np.maximum(wanted, 0.0)).sum())
        self._last = int(rows[-1]), int(stamps[-1])

    def missing(self, rows: int) -> int:
        if self._last is None:
            return self._empty
        if self._empty > SELDOM * rows:
            return 0
        before = self._fit(self._first[0], self._first[1] - self._begun)
        return self._lost + before + self._fit(rows - 1 - self._last[0], self._end - self._last[1])

    def _fit(self, rows: int, span: int) -> int:
        """Values that ``span`` [ns] without one should have held."""
        return min(rows, int(span / max(self._usual, 1.0) + 0.25))
