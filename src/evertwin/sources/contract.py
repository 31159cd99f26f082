"""The contract of a source, and its public checker.

A source gives chunks of one name: ``open`` takes hold of the file or the line, ``chunks`` yields
samples as they arrive, ``close`` lets go and may be called twice. Third parties add theirs under
the entry points ``evertwin.sources``.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Protocol

import numpy as np

from evertwin.errors import LawBroken
from evertwin.fold import Chunk


class Source(Protocol):
    """Samples of one machine part, as they arrive.

    >>> hasattr(Source, "chunks")
    True
    """

    def open(self) -> None:
        """Take hold of the file or connection.

        Raises:
            DataError: it cannot be read.
        """
        ...

    def chunks(self) -> AsyncIterator[Chunk]:
        """The samples, until the source ends."""
        ...

    def close(self) -> None:
        """Let go. May be called again."""
        ...


def check_source(source: Source, limit: int = 1000) -> None:
    """Checks the laws of a source on its first ``limit`` chunks.

    Laws: *rows* (n ≥ 1 in every chunk), *types* (int64 stamps, float64 values), *one source* (name
    and width do not change), *time* (stamps increase strictly within a task, tasks never go back),
    *again* (a recorded source opened again gives the same), *close* (may be called twice).

    Raises:
        LawBroken: names the law and the chunk.
    """
    first = asyncio.run(_collect(source, limit))
    second = asyncio.run(_collect(source, limit))
    for number, chunk in enumerate(first):
        _check_chunk(number, chunk, first[number - 1] if number else chunk)
    same = len(first) == len(second) and all(map(_equal, first, second))
    if not same:
        raise LawBroken("again: opened a second time the source gave other samples")


async def _collect(source: Source, limit: int) -> list[Chunk]:
    source.open()
    out: list[Chunk] = []
    async for chunk in source.chunks():
        out.append(chunk)
        if len(out) >= limit:
            break
    source.close()
    source.close()
    return out


def check_form(number: int, chunk: Chunk, name: str, first: Chunk) -> None:
    """The laws *rows*, *types* and *one source*; ``first`` is one that has been checked, or itself.

    Raises:
        LawBroken: names the law and the chunk.
    """
    if len(chunk.t) < 1 or chunk.v.shape[:1] != chunk.t.shape:
        raise LawBroken(f"rows: chunk {number} has {len(chunk.t)} stamps, {chunk.v.shape} values")
    if chunk.t.dtype != np.int64 or chunk.v.dtype != np.float64 or chunk.v.ndim != 2:
        raise LawBroken(f"types: chunk {number} has {chunk.t.dtype} stamps, {chunk.v.dtype} values")
    if chunk.source != name or chunk.v.shape[1] != first.v.shape[1]:
        raise LawBroken(f"one source: chunk {number} has another name or width")


def _check_chunk(number: int, chunk: Chunk, before: Chunk) -> None:
    check_form(number, chunk, before.source, before)
    if np.any(np.diff(chunk.t) <= 0) or chunk.task < before.task:
        raise LawBroken(f"time: stamps or tasks go back in chunk {number}")
    if chunk is not before and chunk.task == before.task and chunk.t[0] <= before.t[-1]:
        raise LawBroken(f"time: chunk {number} begins before the one before ended")


def _equal(a: Chunk, b: Chunk) -> bool:
    return (
        (a.source, a.task) == (b.source, b.task)
        and np.array_equal(a.t, b.t)
        and np.array_equal(a.v, b.v, equal_nan=True)
    )
