"""Several recorded sources as one stream, merged by stamp.

Chunks leave in windows: up to the earliest of the sources' newest stamps, each source gives what it
has, `MOST` samples at a time. So no source runs ahead of another by more than that, and memory
stays bounded. Tasks are merged one by one; a task whose stamps do not lie after the task before
(files that all count from zero) is moved behind it by one common shift, so that the sources of a
task keep their alignment.

>>> import numpy as np
>>> a = [Chunk("a", np.array([0, 2, 4]), np.zeros((3, 1)))]
>>> b = [Chunk("b", np.array([1, 3]), np.ones((2, 1)))]
>>> [(c.source, c.t.tolist()) for c in merge([iter(a), iter(b)])]
[('a', [0, 2]), ('b', [1, 3]), ('a', [4])]

A part of a recording: ``FILE@START:STOP``, in seconds from its first stamp.

Either end may be left out. A file whose own name holds an ``@`` is a file first.

>>> Excerpt.parse("run.csv@10:20.5")
Excerpt(path=PosixPath('run.csv'), start=10.0, stop=20.5)
>>> Excerpt.parse("run.csv@:60").start, Excerpt.parse("run.csv").whole
(-inf, True)
"""

from __future__ import annotations

import filecmp
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from evertwin.errors import DataError, UsageError
from evertwin.fold import Chunk

GAP = 10 * 10**9
"""Distance that a moved task keeps from the one before; sources that are further apart than that
have clocks of their own [ns]."""
MOST = 2048
"""Samples of a source in one window."""


def merge(
    sources: Sequence[Iterator[Chunk]], gap: int = GAP, moved: dict[int, int] | None = None,
    most: int = MOST,
) -> Iterator[Chunk]:  # fmt: skip
    """Chunks of all sources by stamp, task by task.

    Args:
        sources: one iterator per source, each in order of task and stamp.
        gap: distance [ns] from the end of a task to the start of one that had to be moved.
        moved: is told of each task that is moved, by its number, by how much [ns].
        most: samples of a source in one window; 1: in the order of their stamps.

    Raises:
        DataError: the sources have different numbers of tasks, or do not overlap in time.
    """
    heads = [_Head(source, most) for source in sources]
    end: int | None = None
    while any(head.chunk for head in heads):
        tasks = {head.chunk.task for head in heads if head.chunk}
        if len(tasks) > 1 or not all(head.chunk for head in heads):
            raise DataError("the sources have different numbers of tasks: give each the same files")
        start = min(int(h.chunk.t[0]) for h in heads if h.chunk)
        shift = 0 if end is None or start > end else end + gap - start
        task = tasks.pop()
        if moved is not None and shift:
            moved[task] = shift
        for chunk in _one_task(heads, task):
            there = chunk._replace(t=chunk.t + shift) if shift else chunk
            end = int(there.t[-1]) if end is None else max(end, int(there.t[-1]))
            yield there


def _one_task(heads: Sequence[_Head], task: int) -> Iterator[Chunk]:
    opens = max(head.first for head in heads)
    ends = dict.fromkeys(range(len(heads)), 0)
    while True:
        ready = [h for h in heads if h.chunk and h.chunk.task == task]
        if not ready:
            break
        ends |= {k: int(h.chunk.t[-1]) for k, h in enumerate(heads) if h in ready and h.chunk}
        if len(heads) == 1:
            yield ready[0].rest()
            continue
        edge = min(head.edge for head in ready)
        for head in sorted(ready, key=lambda head: head.first):
            part = head.until(edge)
            if part is not None:
                yield part
    if min(ends.values()) < opens - GAP:
        raise DataError("the sources of this task do not overlap in time: check their clocks")


class _Head:
    """The chunk that a source has ready."""

    def __init__(self, source: Iterator[Chunk], most: int) -> None:
        self.source, self.most = source, most
        self.chunk: Chunk | None = next(source, None)

    @property
    def first(self) -> int:
        """Stamp of its first sample, so that what was earliest leaves first."""
        assert self.chunk is not None
        return int(self.chunk.t[0])

    @property
    def edge(self) -> int:
        """Stamp of its last sample in this window."""
        assert self.chunk is not None
        return int(self.chunk.t[min(len(self.chunk.t), self.most) - 1])

    def rest(self) -> Chunk:
        """All of it."""
        assert self.chunk is not None
        chunk, self.chunk = self.chunk, next(self.source, None)
        return chunk

    def until(self, edge: int) -> Chunk | None:
        """The samples up to ``edge`` [ns]; the rest stays ready."""
        chunk = self.chunk
        if chunk is None:
            return None
        n = int(chunk.t.searchsorted(edge, side="right"))
        if n == len(chunk.t):
            return self.rest()
        self.chunk = chunk._replace(t=chunk.t[n:], v=chunk.v[n:])
        return chunk._replace(t=chunk.t[:n], v=chunk.v[:n]) if n else None


@dataclass(frozen=True)
class Excerpt:
    """Which file, from when to when.

    >>> Excerpt(Path("run.csv"), 10.0).whole
    False
    """

    path: Path
    start: float = -math.inf
    """Seconds from the recording's first stamp; rows at it are in."""
    stop: float = math.inf
    """Rows at it are out, so that parts that meet share no row."""

    @classmethod
    def parse(cls, text: str | Path) -> Excerpt:
        """The part that is meant.

        Raises:
            UsageError: what follows the ``@`` is not START:STOP.
        """
        path, at, span = str(text).rpartition("@")
        if not at or ":" not in span or Path(text).exists():
            return cls(Path(text))
        try:
            start, stop = (float(word) if word else None for word in span.split(":"))
        except ValueError as error:
            raise UsageError(
                f"{text}: expected FILE@START:STOP in seconds from the recording's first stamp, "
                f"such as run.csv@10:20 or run.csv@:60, got {span!r}"
            ) from error
        part = cls(
            Path(path), -math.inf if start is None else start, math.inf if stop is None else stop
        )
        if not part.start < part.stop:
            raise UsageError(f"{text}: expected START < STOP, got {span!r}")
        return part

    @property
    def whole(self) -> bool:
        """Is it the whole recording?"""
        return math.isinf(self.start) and math.isinf(self.stop)

    def of(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """The part's samples; seconds count from the first stamp of all sources together."""
        origin: int | None = None
        for chunk in chunks:
            origin = int(chunk.t[0]) if origin is None else origin
            seconds = (chunk.t - origin) * 1e-9
            inside = (seconds >= self.start) & (seconds < self.stop)
            if inside.all():
                yield chunk
            elif inside.any():
                yield chunk._replace(t=chunk.t[inside], v=chunk.v[inside])


def each_once(parts: Sequence[Excerpt]) -> None:
    """Rows that are given twice would count twice, and halve the intervals.

    Raises:
        UsageError: two parts of one source have rows in common, by the content of their files.
    """
    for a, b in combinations(parts, 2):
        if a.start < b.stop and b.start < a.stop and _alike(a.path, b.path):
            said = f"the same content as {a.path}" if a.path != b.path else "given twice"
            said += "" if a.whole and b.whole else ", and the parts overlap"
            raise UsageError(
                f"{b.path}: {said}: its rows would count twice, as if more were known: name it once"
            )


def _alike(a: Path, b: Path) -> bool:
    """Have two files the same content?"""
    if a == b:
        return True
    there = a.is_file() and b.is_file() and a.stat().st_size == b.stat().st_size > 0
    return there and filecmp.cmp(a, b, shallow=False)
