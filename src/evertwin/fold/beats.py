"""Beats: the rows at which decisions may happen, set by the data and never by a block's edge.

A beat lies *before* a row: when its number is a multiple of ``every``, or when it opens a new
task. Between beats parameters are constant and kernels run.

>>> from evertwin.fold.block import make_block
>>> b = make_block(t=range(7), u=[[0.0]] * 7, y=[[0.0]] * 7)
>>> Beat(every=3).rows(b, task=0).tolist()
[0, 3, 6]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold.block import Block
from evertwin.types import Int64


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

    def rows(self, block: Block, task: int) -> Int64[np.ndarray, " beats"]:
        """Numbers of the block's rows before which a beat lies.

        Args:
            block: the rows.
            task: task of the row before the block (any number before the first row).
        """
        n = len(block.t)
        regular = np.arange(block.row + -block.row % self.every, block.row + n, self.every)
        if not (block.task != task).any():
            return regular
        opens = block.row + np.flatnonzero(np.diff(block.task, prepend=task))
        return np.union1d(regular, opens)
