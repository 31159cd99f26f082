"""Which rows a run has had, as a hash over them; the same however they are cut into blocks.

>>> from evertwin.fold import make_block
>>> rows = make_block(t=range(4), u=[[0.5]] * 4, y=[[1.0]] * 4)
>>> whole, parts = Fingerprint(), Fingerprint()
>>> whole.add(rows); parts.add(take(rows, 0, 1)); parts.add(take(rows, 1, 4))
>>> whole.digest == parts.digest, whole.rows
(True, 4)
"""

from __future__ import annotations

import hashlib

import numpy as np

from evertwin.fold import Block, take


class Fingerprint:
    """A running hash over rows: stamps, values, marks, and where tasks begin.

    >>> Fingerprint().rows
    0
    """

    def __init__(self) -> None:
        self._hash = hashlib.blake2b(digest_size=20)
        self._task: int | None = None
        self.rows = 0

    @property
    def digest(self) -> str:
        """The hash over all rows so far."""
        return self._hash.hexdigest()

    def add(self, block: Block) -> None:
        """Further rows."""
        n = len(block.t)
        if n == 0:
            return
        before = int(block.task[0]) if self._task is None else self._task
        begins = np.diff(block.task, prepend=before) != 0
        columns = [block.t[:, None], block.u, block.y, block.mark, begins[:, None]]
        raw = [np.ascontiguousarray(part).view(np.uint8).reshape(n, -1) for part in columns]
        self._hash.update(np.concatenate(raw, axis=1).data)
        self._task, self.rows = int(block.task[-1]), self.rows + n


class Followed:
    """The fingerprint of what a run has folded, at any row of the block that it is in.

    >>> Followed().at(0) == Fingerprint().digest
    True
    """

    def __init__(self) -> None:
        self._print = Fingerprint()
        self._block: Block | None = None
        self.first = ""
        """The hash over the first row alone."""

    def begin(self, block: Block) -> None:
        """The run goes on to a block; the one before is done."""
        if not self.first:
            one = Fingerprint()
            one.add(take(block, 0, 1))
            self.first = one.digest
        self._to(None)
        self._block = block

    def at(self, row: int) -> str:
        """The hash over the rows before ``row``, which only grows."""
        self._to(row)
        return self._print.digest

    def _to(self, row: int | None) -> None:
        block, done = self._block, self._print.rows
        if block is None:
            return
        stop = len(block.t) if row is None else row - block.row
        self._print.add(take(block, done - block.row, stop))
