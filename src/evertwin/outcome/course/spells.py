"""A stretch of rows on which a twin did not fit its machine, which it fits before and after."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.types import Vector

MOST = 0.2
"""Share of the rows that such a stretch takes at most."""
LEAST = 30
"""Rows after it that tell that it is over, at least; and as many as it is long."""


class Spell(NamedTuple):
    """Rows that were off, and by how much.

    >>> Spell(5, 9, 2.0, 0.1).last
    9
    """

    first: int
    last: int
    inside: float
    """Rms on these rows."""
    outside: float
    """Rms on all others."""


def spell(row: np.ndarray, off: Vector, limit: float) -> Spell | None:
    """The stretch without which all other rows are within ``limit``; None: there is none.

    Args:
        row: numbers of the rows, (n,).
        off: what predictions were off by, (n,); NaN where that does not count.
        limit: rms that is asked.

    >>> off = np.where((np.arange(400) >= 200) & (np.arange(400) < 240), 3.0, 0.25)
    >>> spell(np.arange(400), off, 0.5)
    Spell(first=200, last=239, inside=3.0, outside=0.25)
    >>> spell(np.arange(240), off[:240], 0.5) is None
    True
    """
    known = np.isfinite(off)
    row, square = row[known], np.square(off[known])
    if not len(square):
        return None
    sums = np.concatenate([[0.0], np.cumsum(square - limit * limit)])
    stop = int(np.argmax(sums - np.minimum.accumulate(sums)))
    first = int(np.argmin(sums[: stop + 1]))
    inside, after = square[first:stop], square[stop:]
    outside = np.concatenate([square[:first], after])
    short = len(inside) <= MOST * len(square) and len(after) >= max(LEAST, len(inside))
    if not (len(inside) and short and max(outside.mean(), after.mean()) <= limit * limit):
        return None
    by = [float(np.sqrt(part.mean())) for part in (inside, outside)]
    return Spell(int(row[first]), int(row[stop - 1]), *by)
