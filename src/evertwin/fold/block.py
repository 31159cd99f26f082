"""A block: n ≥ 1 consecutive rows of a machine's data, on one clock.

Row ``i`` holds the input ``u[i]`` that acted over the interval ``dt[i]`` *into* the row and the
output ``y[i]`` measured at its end, stamped ``t[i]``. The first row of a stream has ``dt = 0``.
Where the data is cut into blocks must never matter (the partition law, `evertwin.fold.laws`).

>>> import numpy as np
>>> b = make_block(t=[0, 10**9, 2 * 10**9], u=[[1.0]] * 3, y=[[0.0], [1.0], [np.nan]])
>>> b.dt.tolist(), b.mark[:, 1].tolist()
([0.0, 1.0, 1.0], [0, 0, 1])
>>> [len(piece.t) for piece in (take(b, 0, 2), take(b, 2, 3))]
[2, 1]
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from evertwin.errors import DataError
from evertwin.fold.marks import Mark
from evertwin.types import Bools, Inputs, Intervals, Marks, Outputs, Stamps, Tasks

LARGEST = 1e100
"""Largest size of a number that can be a measurement: beyond it squares would overflow."""


class Block(NamedTuple):
    """Consecutive rows. Built at the edges by `make_block`, trusted inside.

    >>> make_block(t=[0], u=[[0.0]], y=[[1.0]]).row
    0
    """

    row: int
    """Number of the first row in the stream."""
    t: Stamps
    """Stamps [ns], strictly increasing."""
    dt: Intervals
    """Interval into each row [s], the exact difference of the stamps; 0 for the first row."""
    u: Inputs
    """Inputs held over the interval, (n, nu)."""
    y: Outputs
    """Outputs at its end, (n, ny); NaN where nothing was measured."""
    mark: Marks
    """`Mark` of each input, then of each output, (n, nu + ny)."""
    task: Tasks
    """Number of the task (one file, one work cycle) that the row belongs to."""
    gap: Bools
    """True where the interval is too long to be simulated over: the state starts anew."""

    def __repr__(self) -> str:
        last = self.row + len(self.t) - 1
        return f"<Block: rows {self.row} to {last}, u {self.u.shape}, y {self.y.shape}>"


def make_block(
    t: ArrayLike,
    u: ArrayLike,
    y: ArrayLike,
    *,
    before: int | None = None,
    row: int = 0,
    task: ArrayLike = 0,
) -> Block:
    """A validated block from plain arrays.

    Args:
        t: stamps [ns], (n,) integers, strictly increasing.
        u: inputs, (n, nu).
        y: outputs, (n, ny); NaN becomes the mark ``absent``, infinity and what is beyond
            `LARGEST` ``error`` (and NaN).
        before: stamp of the row before the first one [ns]; None at the start of a stream.
        row: number of the first row.
        task: task number, one or (n,). A row that opens another task starts anew (``gap``).

    Raises:
        DataError: shapes do not agree or the stamps do not increase.
    """
    stamps = np.array(t, dtype=np.int64).reshape(-1)
    inputs = np.array(u, dtype=np.float64).reshape(len(stamps), -1)
    outputs = np.array(y, dtype=np.float64).reshape(len(stamps), -1)
    tasks = np.broadcast_to(np.asarray(task, dtype=np.int64), stamps.shape).copy()
    if len(stamps) == 0:
        raise DataError("a block holds at least one row, got none: give one row or no block")
    first = stamps[0] if before is None else before
    steps = np.diff(stamps, prepend=np.int64(first))
    bad = np.flatnonzero(steps[1:] <= 0)
    if len(bad) or (before is not None and steps[0] <= 0):
        at = int(bad[0]) + 1 if len(bad) else 0
        raise DataError(
            f"row {row + at}: expected a stamp after the row before, got a step of "
            f"{int(steps[at])} ns: repeated and backward stamps are dropped or marked by a source"
        )
    for side in (inputs, outputs):
        side[np.abs(side) > LARGEST] = np.inf
    values = np.concatenate([inputs, outputs], axis=1)
    mark = np.where(np.isnan(values), Mark.ABSENT, Mark.OK).astype(np.uint8)
    mark[np.isinf(values)] = Mark.ERROR
    outputs[np.isinf(outputs)] = np.nan
    gap = np.zeros(len(stamps), dtype=np.bool_)
    gap[1:] = tasks[1:] != tasks[:-1]
    return Block(row, stamps, steps * 1e-9, inputs, outputs, mark, tasks, gap)


Windows = tuple[Block, ...]
"""Stretches of rows, in the order of time."""


def take(block: Block, start: int, stop: int) -> Block:
    """Rows ``start`` to ``stop`` (positions in the block), as views."""
    if start == 0 and stop >= len(block.t):
        return block
    return Block(block.row + start, *[column[start:stop] for column in block[1:]])


def first(blocks: Sequence[Block], rows: int) -> tuple[Block, ...]:
    """The first whole blocks, about so many ``rows``; at least one."""
    ends = accumulate(len(block.t) for block in blocks)
    return (*blocks[:1], *(b for b, end in list(zip(blocks, ends))[1:] if end <= rows))


def concatenate(blocks: Sequence[Block]) -> Block:
    """One block from consecutive ones.

    Raises:
        DataError: the row numbers do not follow each other.
    """
    expected = blocks[0].row
    for block in blocks:
        if block.row != expected:
            raise DataError(f"expected a block that starts at row {expected}, got {block.row}")
        expected += len(block.t)
    columns = zip(*(b[1:] for b in blocks), strict=True)
    return Block(blocks[0].row, *(np.concatenate(column) for column in columns))
