"""Rows while a recording is read: the rows of `evertwin.loop.tasks`, in bounded memory.

Where nothing needs a whole task, a row is complete as soon as every source has passed its stamp.
Only a measured input that is missing at a row has to wait for its next sample, between which and
the last one it is interpolated. Bit for bit the rows that a task in memory gives.

>>> chunks = [Chunk("log", np.array([0, 10]), np.array([[1.0, 5.0], [2.0, 6.0]])),
...           Chunk("log", np.array([20]), np.array([[3.0, 7.0]]))]
>>> plan = Plan(held=np.array([0]), lines=np.array([-1]), inputs=1, outputs=np.array([1]))
>>> [block.u.ravel().tolist() for block in stream([iter(chunks)], [2], plan)]
[[1.0, 1.0], [2.0]]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from evertwin.errors import DataError
from evertwin.fold import Block, Chunk, make_block
from evertwin.types import Stamps

__all__ = ["Plan", "stream"]

MOST = 8_192
"""Rows of a block: few, since every stage holds some copies of one."""

Values = Float64[np.ndarray, "n columns"]


class Plan(NamedTuple):
    """Which columns of the sources, side by side, become what.

    >>> Plan(np.array([0]), np.array([1]), 2, np.array([2])).gap
    inf
    """

    held: Int64[np.ndarray, " held"]
    """Column of each input, −1 where it is not a command: the newest value before the interval."""
    lines: Int64[np.ndarray, " lines"]
    """Column of each input, −1 where it is not measured: the value at the row."""
    inputs: int
    outputs: Int64[np.ndarray, " ny"]
    """Column of each output."""
    gap: float = float("inf")
    """Longest interval that is simulated over [s]."""


def stream(
    sources: Sequence[Iterator[Chunk]], widths: Sequence[int], plan: Plan
) -> Iterator[Block]:
    """The rows of the sources on the union of their stamps, task by task.

    Args:
        sources: one iterator per source, in order of task and stamp.
        widths: columns of each source.
        plan: where the model's channels are among all of them.

    Raises:
        DataError: the sources have different numbers of tasks.
    """
    heads = [_Head(source) for source in sources]
    row, number = 0, 0
    while any(head.chunk for head in heads):
        if not all(head.chunk for head in heads):
            raise DataError("the sources have different numbers of tasks: give each the same files")
        task = _Task(plan, row, number)
        for t, v in _windows(heads, widths):
            for start in range(0, len(t), MOST):
                part = slice(start, start + MOST)
                yield from task.rows(t[part], v[part], last=False)
        yield from task.rows(np.zeros(0, dtype=np.int64), np.zeros((0, sum(widths))), last=True)
        if task.row > row:
            row, number = task.row, number + 1


def _windows(heads: Sequence[_Head], widths: Sequence[int]) -> Iterator[tuple[Stamps, Values]]:
    """Rows of the heads' present task that no source will add to."""
    tasks = [head.task for head in heads]
    while True:
        ready = [h.task == task for h, task in zip(heads, tasks, strict=True)]
        if not any(ready):
            return
        edge = min(head.last for head, there in zip(heads, ready, strict=True) if there)
        parts = [h.until(edge) if there else None for h, there in zip(heads, ready, strict=True)]
        if len(parts) == 1 and parts[0] is not None:
            yield parts[0].t, parts[0].v
            continue
        found = [part for part in parts if part is not None]
        t = np.unique(np.concatenate([part.t for part in found]))
        v, at = np.full((len(t), sum(widths)), np.nan), 0
        for part, width in zip(parts, widths, strict=True):
            if part is not None:
                v[np.searchsorted(t, part.t), at : at + width] = part.v
            at += width
        yield t, v


class _Head:
    """The chunk that a source has ready."""

    def __init__(self, source: Iterator[Chunk]) -> None:
        self.source = source
        self.chunk: Chunk | None = next(source, None)

    @property
    def task(self) -> int:
        """Its task; −1 at the end."""
        return -1 if self.chunk is None else self.chunk.task

    @property
    def last(self) -> int:
        """Its newest stamp."""
        assert self.chunk is not None
        return int(self.chunk.t[-1])

    def until(self, edge: int) -> Chunk | None:
        """The samples up to ``edge`` [ns]; the rest stays ready."""
        chunk = self.chunk
        assert chunk is not None
        n = int(np.searchsorted(chunk.t, edge, side="right"))
        if n == len(chunk.t):
            self.chunk = next(self.source, None)
            return chunk
        self.chunk = chunk._replace(t=chunk.t[n:], v=chunk.v[n:])
        return chunk._replace(t=chunk.t[:n], v=chunk.v[:n]) if n else None


@dataclass
class _Task:
    """One task on its way to rows."""

    plan: Plan
    row: int
    number: int
    before: int | None = None
    """Stamp of the last row."""
    waiting: list[tuple[Stamps, Values]] = field(default_factory=list)
    newest: dict[int, float] = field(default_factory=dict)
    """Newest value per held column."""
    known: dict[int, tuple[int, float]] = field(default_factory=dict)
    """Stamp and value of the newest sample per measured column."""

    def rows(self, t: Stamps, v: Values, *, last: bool) -> Iterator[Block]:
        """The rows that are complete with these samples."""
        self.waiting.append((t, v))
        if not last and not self._complete(v):
            return
        if len(self.waiting) > 1:
            t = np.concatenate([part for part, _ in self.waiting])
            v = np.concatenate([part for _, part in self.waiting])
        n = len(t) if last else self._released(v)
        self.waiting = [(t[n:], v[n:])] if n < len(t) else []
        if n:
            yield self._block(t, v, n)

    def _complete(self, v: Values) -> bool:
        """Has every measured input a sample among the newest? Else nothing is released."""
        lines = self.plan.lines[self.plan.lines >= 0]
        return bool((~np.isnan(v[:, lines])).any(axis=0).all())

    def _released(self, v: Values) -> int:
        """Rows up to which every measured input is known or lies between two samples."""
        n = len(v)
        for column in self.plan.lines[self.plan.lines >= 0].tolist():
            if np.isnan(v[-1, column]):
                there = np.flatnonzero(~np.isnan(v[:, column]))
                n = min(n, int(there[-1]) + 1 if len(there) else 0)
        return n

    def _block(self, t: Stamps, v: Values, n: int) -> Block:
        plan, first = self.plan, self.before is None
        block = make_block(
            t[:n], self._inputs(t, v, n), v[:n, plan.outputs], before=self.before, row=self.row,
            task=self.number,
        )  # fmt: skip
        gap = block.gap | (block.dt > plan.gap)
        gap[0] |= first
        self.before, self.row = int(t[n - 1]), self.row + n
        return block._replace(gap=gap)

    def _inputs(self, t: Stamps, v: Values, n: int) -> Float64[np.ndarray, "released inputs"]:
        u = np.empty((n, self.plan.inputs))
        for k, (held, line) in enumerate(zip(self.plan.held, self.plan.lines, strict=True)):
            u[:, k] = self._held(v, int(held), n) if held >= 0 else self._line(t, v, int(line), n)
        return u

    def _held(self, v: Values, column: int, n: int) -> np.ndarray:
        """The newest value at or before the row before."""
        values = v[:n, column]
        before = self.newest.get(column, np.nan)
        missing = np.isnan(values)
        if missing.any():
            place = np.maximum.accumulate(np.where(missing, -1, np.arange(n)))
            values = np.where(place < 0, before, values[place])
        self.newest[column] = float(values[-1])
        start = values[0] if self.before is None else before
        return np.concatenate([[start], values[:-1]])

    def _line(self, t: Stamps, v: Values, column: int, n: int) -> np.ndarray:
        """The value at the row, interpolated where there is none."""
        values = v[:, column]
        there = np.flatnonzero(~np.isnan(values))
        out = values[:n]
        if len(there) < len(values) and (len(there) or column in self.known):
            stamps, samples = t[there], values[there]
            if column in self.known:
                stamp, sample = self.known[column]
                stamps, samples = np.r_[stamp, stamps], np.r_[sample, samples]
            out = np.interp(t[:n], stamps, samples)
        there = there[there < n]
        if len(there):
            self.known[column] = int(t[there[-1]]), float(values[there[-1]])
        return out
