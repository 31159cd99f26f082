"""How many rows a second the data has: a time in the twin file is so many of them.

>>> from evertwin.fold import make_block
>>> rows = make_block(t=np.arange(9) * 10**8, u=np.zeros((9, 1)), y=np.zeros((9, 1)))
>>> rate, blocks = measured([take(rows, 0, 2), take(rows, 2, 9)])
>>> rate, [len(block.t) for block in blocks]
(10.0, [2, 7])
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from evertwin.fold import Block, concatenate, take

ENOUGH = 64
"""Rows that the rate is taken from: the first ones, so that it never changes on the way."""


def measured(blocks: Iterable[Block]) -> tuple[float | None, Iterator[Block]]:
    """Rows per second of the first rows, and all the blocks."""
    stream, first = iter(blocks), list[Block]()
    while sum(len(block.t) for block in first) < ENOUGH:
        block = next(stream, None)
        if block is None:
            break
        first.append(block)
    return rate_of(first), chain(first, stream)


def rate_of(blocks: list[Block]) -> float | None:
    """Rows per second of the first rows; None where there is but one.

    Intervals over a gap do not count.
    """
    if not blocks:
        return None
    rows = concatenate(blocks)
    inside = take(rows, 0, min(ENOUGH, len(rows.t)))
    steps = inside.dt[~inside.gap & (inside.dt > 0.0)]
    return float(1.0 / np.mean(steps)) if len(steps) else None
