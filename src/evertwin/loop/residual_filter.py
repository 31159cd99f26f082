"""The one filter over both sides: residual rows are filtered, so measurement and prediction are.

A filter is linear, so filtering ``measured − predicted`` is filtering both with the same filter.
Zero-phase filters need a whole task: rows wait until it ends. Without a filter rows pass.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from evertwin.errors import DataError
from evertwin.loop.scores import Released
from evertwin.signals.filters import Butterworth

__all__ = ["Pass", "Smooth", "ZeroPhase"]


class Smooth(Protocol):
    """Rows in, released rows out, now or later.

    >>> hasattr(Smooth, "flush")
    True
    """

    def init(self) -> Any:
        """Nothing is waiting."""
        ...

    def step(self, state: Any, rows: Released) -> tuple[Any, Released]:
        """Consumes ``state``."""
        ...

    def flush(self, state: Any) -> tuple[Any, Released | None]:
        """What is released because the task ends."""
        ...


@dataclass(frozen=True)
class Pass:
    """No filter: rows pass at once.

    >>> Pass().init()
    ()
    """

    def init(self) -> tuple[()]:
        """Nothing waits, ever."""
        return ()

    def step(self, state: tuple[()], rows: Released) -> tuple[tuple[()], Released]:
        """The rows as they are."""
        return state, rows

    def flush(self, state: tuple[()]) -> tuple[tuple[()], None]:
        """Nothing."""
        return state, None


class Waiting(NamedTuple):
    """Rows that wait for the end of their task.

    >>> Waiting._fields[0]
    'waiting'
    """

    waiting: np.ndarray
    row: np.ndarray
    t: np.ndarray
    phase: np.ndarray
    values: np.ndarray
    """measured, live, first, other side by side, (capacity, 4·ny)."""
    moving: np.ndarray
    end: np.ndarray


@dataclass(frozen=True)
class ZeroPhase:
    """Butterworth forward and backward over each task.

    >>> ZeroPhase(rate=100.0, cutoff=5.0, order=4, outputs=6, capacity=1000).order
    4
    """

    rate: float
    """Rate of the rows [Hz]."""
    cutoff: float
    """Corner of one pass [Hz]."""
    order: int
    outputs: int
    capacity: int
    """Most rows of one task."""

    def init(self) -> Waiting:
        n = self.capacity
        row, t, phase = (np.zeros(n, np.int64) for _ in range(3))
        values, moving = np.zeros((n, 4 * self.outputs)), np.zeros((n, self.outputs), np.bool_)
        return Waiting(np.zeros(1, np.int64), row, t, phase, values, moving, np.zeros(n, np.bool_))

    def step(self, state: Waiting, rows: Released) -> tuple[Waiting, Released]:
        """The rows wait.

        Raises:
            DataError: the task is longer than the capacity.
        """
        a = int(state.waiting[0])
        b = a + len(rows.row)
        if b > self.capacity:
            raise DataError(
                f"a zero-phase filter holds a whole task: expected at most {self.capacity} rows, "
                f"row {int(rows.row[-1])} is beyond: raise tuning.window or use kind = 'savgol'"
            )
        state.row[a:b], state.t[a:b], state.phase[a:b] = rows.row, rows.t, rows.phase
        state.moving[a:b], state.end[a:b] = rows.moving, rows.end
        state.values[a:b] = np.concatenate(rows[3:7], axis=1)
        state.waiting[0] = b
        return state, _slice(state, 0, 0, self.outputs)

    def flush(self, state: Waiting) -> tuple[Waiting, Released | None]:
        n = int(state.waiting[0])
        if n == 0:
            return state, None
        values = state.values[:n]
        known = ~np.isnan(values).all(axis=1)
        state.values[:n] = self.smooth(values)
        rows = _slice(state, 0, n, self.outputs)
        state.waiting[0] = 0
        return state, rows if known.any() else None

    @cached_property
    def _filter(self) -> Butterworth:
        return Butterworth(self.cutoff, self.rate, self.order)

    def smooth(self, values: np.ndarray) -> np.ndarray:
        """Columns (n, k) filtered; unknown rows are bridged and stay unknown."""
        n = len(values)
        out = np.full_like(values, np.nan)
        for k in range(values.shape[1]):
            known = np.flatnonzero(~np.isnan(values[:, k]))
            if len(known) >= self._filter.shortest:
                bridged = np.interp(np.arange(n), known, values[known, k])
                out[known, k] = self._filter(bridged[:, None])[known, 0]
        return out


def _slice(state: Waiting, start: int, stop: int, ny: int) -> Released:
    values = state.values[start:stop].copy()
    measured, live, first, other = (values[:, i * ny : (i + 1) * ny] for i in range(4))
    rows = slice(start, stop)
    row, t, phase = state.row[rows].copy(), state.t[rows].copy(), state.phase[rows].copy()
    moving, end = state.moving[rows].copy(), state.end[rows].copy()
    return Released(row, t, phase, measured, live, first, other, moving, end)
