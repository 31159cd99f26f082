"""The newest rows of the stream, kept for slow work. Fixed capacity, filled in place.

>>> from evertwin.fold import make_block
>>> ring = Ring(capacity=3, nu=1, ny=1)
>>> rows = make_block(t=range(5), u=[[float(i)] for i in range(5)], y=[[0.0]] * 5)
>>> ring.between(ring.push(ring.init(), rows), 0, 5)[0].u.ravel().tolist()
[2.0, 3.0, 4.0]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Block, Mark, take
from evertwin.rows.stayed import count, handed_on, none

UNSEEN, UNMOVED = np.zeros((2, 2, 0)), none(0)


class Rows(NamedTuple):
    """State of `Ring`: rows by number modulo capacity.

    >>> Ring(capacity=2, nu=1, ny=1).init().end
    0
    """

    end: int
    """Number of the row after the newest."""
    t: np.ndarray
    dt: np.ndarray
    u: np.ndarray
    y: np.ndarray
    mark: np.ndarray
    task: np.ndarray
    gap: np.ndarray
    out: np.ndarray
    """Rows that a person called faulty: they are in no window."""
    first: int = 0
    """Number of the first row there ever was; rows of runs before have numbers below 0."""
    seen: np.ndarray = UNSEEN
    """Lowest and highest value of each input on rows that are kept no longer, since the live
    version went live, now and when work was asked for last, (2, 2, nu)."""
    stayed: np.ndarray = UNMOVED
    """How long each input stayed where it was, over all rows (`evertwin.rows.stayed`)."""


@dataclass(frozen=True)
class Ring:
    """The newest ``capacity`` rows.

    >>> Ring(capacity=100, nu=2, ny=1).capacity
    100
    """

    capacity: int
    nu: int
    ny: int

    def __post_init__(self) -> None:
        if self.capacity < 1:
            raise UsageError(f"window: expected at least 1 row, got {self.capacity}")

    def init(self) -> Rows:
        """No rows."""
        n = self.capacity
        return Rows(
            0, np.zeros(n, np.int64), np.zeros(n), np.zeros((n, self.nu)), np.zeros((n, self.ny)),
            np.zeros((n, self.nu + self.ny), np.uint8), np.zeros(n, np.int64),
            np.zeros(n, np.bool_), np.zeros(n, np.bool_), 0, self.unseen(), none(self.nu),
        )  # fmt: skip

    def unseen(self) -> np.ndarray:
        """No range of any input."""
        return np.tile([[[np.inf], [-np.inf]]], (2, 1, self.nu))

    def push(self, rows: Rows, block: Block) -> Rows:
        """With the block's rows; the oldest make room. Consumes ``rows``."""
        n, capacity = len(block.t), self.capacity
        source = max(0, n - capacity)
        self._forget(rows, block, source)
        count(rows.stayed, block.row, block.u)
        while source < n:
            place = (block.row + source) % capacity
            stop = min(place + n - source, capacity)
            for ring, new in zip(rows[1:8], block[1:], strict=True):
                ring[place:stop] = new[source : source + stop - place]
            rows.out[place:stop] = False
            source += stop - place
        return rows._replace(end=block.row + n)

    def _forget(self, rows: Rows, block: Block, skipped: int) -> None:
        """Rows that make room, and those of the block that never come, count in the range seen."""
        last = block.row + len(block.t) - self.capacity
        if last <= max(rows.first, rows.end - self.capacity):
            return
        places = kept(rows, rows.first, min(last, rows.end))
        u = np.concatenate([rows.u[places], block.u[:skipped]])
        mark = np.concatenate([rows.mark[places], block.mark[:skipped]])[:, : self.nu]
        u = np.where(mark < Mark.CONTESTED, u, np.nan)
        low, high = rows.seen[0]
        np.fmin(low, np.fmin.reduce(u, axis=0, initial=np.inf), out=low)
        np.fmax(high, np.fmax.reduce(u, axis=0, initial=-np.inf), out=high)

    def handed_on(self, rows: Rows) -> Rows:
        """The rows as those before row 0 of another run, their tasks before its task 0. Consumes
        ``rows``, whose capacity may be another one: that of a run at another rate."""
        size = len(rows.t)
        if not rows.end and size == self.capacity:
            return rows
        places = kept(rows, rows.end - self.capacity)
        new = self.init()._replace(first=-len(places))
        for name in Rows._fields[1:9]:
            getattr(new, name)[self.capacity - len(places) :] = getattr(rows, name)[places]
        new.task[:] -= new.task[-1] + 1
        new.seen[:], new.stayed[:] = rows.seen, handed_on(rows.stayed, rows.end)
        return new

    def leave_out(self, rows: Rows, first: int, last: int) -> int:
        """Rows ``first`` to ``last`` are in no window any more; how many of them are kept. Consumes
        ``rows``."""
        places = kept(rows, first, min(last + 1, rows.end))
        rows.out[places] = True
        return len(places)

    def between(self, rows: Rows, start: int, stop: int) -> tuple[Block, ...]:
        """Copies of the kept rows with numbers in [start, stop), task by task, without those that
        are left out: predictions begin anew behind them."""
        first = max(start, rows.end - self.capacity, rows.first)
        if stop <= first:
            return ()
        places = kept(rows, first, stop)
        return split(Block(first, *(column[places] for column in rows[1:8])), rows.out[places])


def kept(rows: Rows, first: int, stop: int | None = None) -> np.ndarray:
    """Places of the rows with numbers in [first, stop) that are kept, in order; None: to the end.

    >>> rows = Ring(capacity=3, nu=1, ny=1).init()._replace(end=5)
    >>> kept(rows, 0).tolist(), kept(rows, 1, 4).tolist()
    ([2, 0, 1], [2, 0])
    """
    stop = rows.end if stop is None else stop
    start = min(max(first, rows.end - len(rows.t), rows.first), stop)
    return np.arange(start, stop) % len(rows.t)


def split(block: Block, out: np.ndarray) -> tuple[Block, ...]:
    """The block's tasks, each a window of its own, and the pieces that ``out`` cuts them into."""
    opens = np.flatnonzero((np.diff(block.task) != 0) | (np.diff(out) != 0)) + 1
    edges: Any = [0, *opens.tolist(), len(block.t)]
    return tuple(take(block, a, b) for a, b in pairwise(edges) if not out[a])


def called(row: int) -> str:
    """A row in words.

    >>> called(5), called(-5)
    ('row 5', 'row -5, in a run before')
    """
    return f"row {row}" if row >= 0 else f"row {row}, in a run before"


NO_ROWS = Ring(capacity=1, nu=0, ny=0).init()
"""In place of newest rows that are not copied."""


def refuse(rows: Rows, columns: Sequence[int], first: int, last: int) -> None:
    """Kept rows count no more in these ``columns`` of the marks. Writes into ``rows``."""
    places = kept(rows, first, last + 1)
    for column in columns:
        mark = rows.mark[places, column]
        rows.mark[places, column] = np.where(mark == Mark.ABSENT, mark, np.uint8(Mark.ERROR))


def reread(rows: Rows, column: int, factor: float, first: int) -> None:
    """Kept rows from ``first`` on whose input in this ``column`` was believed as it was recorded:
    it is divided by a factor, and marked so. Writes into ``rows``."""
    places = kept(rows, first)
    places = places[rows.mark[places, column] < Mark.CONTESTED]
    rows.u[places, column] /= factor
    rows.mark[places, column] = Mark.ERROR
