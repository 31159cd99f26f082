"""Beats: the rows at which decisions may happen, set by the data and never by a block's edge.

A beat lies *before* a row: when its number is a multiple of ``every``, or when it opens a new
task. Between beats parameters are constant and kernels run.

>>> from evertwin.fold.block import make_block
>>> b = make_block(t=range(7), u=[[0.0]] * 7, y=[[0.0]] * 7)
>>> [(at, len(piece.t)) for at, piece in Beat(every=3).pieces(b, task=0)]
[(True, 3), (True, 3), (True, 1)]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold.block import Block, take

__all__ = ["Beat"]


@dataclass(frozen=True)
class Beat:
    """The grid of decisions.

    >>> Beat(every=100).every
    100
    """

    every: int
    """Rows from beat to beat."""

    def __post_init__(self) -> None:
        if self.every < 1:
            raise UsageError(f"beat: expected at least 1 row, got {self.every}")

    def pieces(self, block: Block, task: int) -> Iterator[tuple[bool, Block]]:
        """The block cut at its beats: (does a beat precede this piece?, piece).

        Args:
            block: the rows.
            task: task of the row before the block (any number before the first row).
        """
        n = len(block.t)
        first = -block.row % self.every
        opens = np.flatnonzero(block.task[1:] != block.task[:-1]) + 1 if n > 1 else None
        cuts = set(range(first, n, self.every))
        if opens is not None and len(opens):
            cuts.update(opens.tolist())
        at_start = first == 0 or int(block.task[0]) != task
        edges = sorted(cuts | {0}) if cuts else [0]
        if len(edges) == 1:
            yield at_start, block
            return
        for start, stop in zip(edges, [*edges[1:], n], strict=True):
            yield start > 0 or at_start, take(block, start, stop)
