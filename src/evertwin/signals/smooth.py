"""A symmetric FIR in the stream: smooth or derived channels, m rows late, phase untouched.

Row i leaves when row i + m has come, with its filtered channels computed from rows i − m … i + m.
Where that window meets a gap, another task, an uneven interval or a value that is not finite, the
filtered channel is NaN and marked absent: no value is invented. The last m rows stay in the state;
`Smooth.flush` gives them up when the stream has ended.

>>> import numpy as np
>>> from evertwin.fold import fold, make_block
>>> from evertwin.signals.filters import SavitzkyGolay
>>> t = np.arange(9) * 10_000_000
>>> block = make_block(t=t, u=np.zeros((9, 1)), y=np.arange(9.0)[:, None] ** 2)
>>> stage = Smooth(SavitzkyGolay(window=5, rate=100.0), (1,), 1, 1)
>>> rows = fold(stage, [block])[1].rows
>>> rows.y[:, 0].round(9).tolist()
[nan, nan, 4.0, 9.0, 16.0, 25.0, 36.0]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Block, Mark, Out
from evertwin.signals.filters import SavitzkyGolay
from evertwin.signals.smooth_kernel import Lines, slide
from evertwin.types import Bools, Inputs, Intervals, Marks, Outputs, Stamps, Tasks

__all__ = ["Smooth", "SmoothState", "Smoothed"]


class Smoothed(NamedTuple):
    """Rows that left: the arrays of a block, with the number of each row.

    >>> Smoothed._fields[0]
    'row'
    """

    row: Stamps
    t: Stamps
    dt: Intervals
    u: Inputs
    y: Outputs
    mark: Marks
    task: Tasks
    gap: Bools

    def block(self) -> Block:
        """The rows as a block for the next stage."""
        return Block(int(self.row[0]), *self[1:])


class SmoothState(NamedTuple):
    """The last rows, in a ring of the window's length.

    >>> SmoothState._fields
    ('row', 'counters', 'ring')
    """

    row: int
    """Number of the next row that leaves."""
    counters: Stamps
    """Rows that have come in; newest rows in one even stretch without a gap."""
    ring: Lines


@dataclass(frozen=True)
class Smooth:
    """The stage: `Online` over blocks.

    >>> from evertwin.signals.filters import SavitzkyGolay
    >>> Smooth(SavitzkyGolay(window=5, rate=100.0), (1,), 1, 1).filter.delay
    2
    """

    filter: SavitzkyGolay
    columns: tuple[int, ...]
    """Positions of the filtered channels among inputs, then outputs."""
    nu: int
    ny: int

    def __post_init__(self) -> None:
        if not all(0 <= c < self.nu + self.ny for c in self.columns):
            raise UsageError(
                f"smooth: expected columns below {self.nu + self.ny}, got {self.columns}"
            )

    def init(self) -> SmoothState:
        """An empty ring."""
        return SmoothState(0, np.zeros(2, np.int64), self._lines(self.filter.window))

    def step(self, state: SmoothState, block: Block) -> tuple[SmoothState, Out]:
        """Rows in, rows out ``filter.delay`` later."""
        values = np.concatenate([block.u, block.y], axis=1)
        lines = Lines(block.t, block.dt, values, block.mark, block.task, block.gap)
        row = state.row if state.counters[0] else block.row
        out = self._lines(len(block.t))
        left = self._slide(state, lines, out)
        return state._replace(row=row + left), Out(self._rows(row, out, left))

    def flush(self, state: SmoothState) -> Out:
        """The rows that are still inside, their filtered channels absent."""
        inside = min(int(state.counters[0]), self.filter.delay)
        first = int(state.counters[0]) - inside
        at = np.arange(first, first + inside) % self.filter.window
        out = Lines(*(array[at] for array in state.ring))
        columns = list(self.columns)
        out.v[:, columns] = np.nan
        out.mark[:, columns] = np.maximum(out.mark[:, columns], np.uint8(Mark.ABSENT))
        return Out(self._rows(state.row, out, inside))

    def _slide(self, state: SmoothState, lines: Lines, out: Lines) -> int:
        columns = np.array(self.columns, dtype=np.int64)
        taps = np.append(self.filter.taps, 1 / self.filter.rate)
        return int(slide(state.ring, state.counters, lines, out, columns, taps))

    def _lines(self, n: int) -> Lines:
        k = self.nu + self.ny
        return Lines(
            np.zeros(n, np.int64), np.zeros(n), np.zeros((n, k)), np.zeros((n, k), np.uint8),
            np.zeros(n, np.int64), np.zeros(n, np.bool_),
        )  # fmt: skip

    def _rows(self, row: int, out: Lines, left: int) -> Smoothed | None:
        if left == 0:
            return None
        t, dt, v, mark, task, gap = (array[:left] for array in out)
        numbers = np.arange(row, row + left, dtype=np.int64)
        return Smoothed(numbers, t, dt, v[:, : self.nu], v[:, self.nu :], mark, task, gap)
