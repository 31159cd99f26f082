"""How long each input stayed where it was, to the last digit, over all rows of a twin.

The longest stretch is kept, and that of any other value: what a closed valve holds for hours says
nothing of how long it stays half open.

>>> known = none(1)
>>> count(known, 0, np.array([[0.0], [0.0], [0.0], [5.0], [7.0], [7.0], [0.0], [0.0]]))
>>> longest(known[0], 0.0, 6), longest(known[0], 7.0, 6)
(3, 2)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.types import Inputs, Vector

VALUE, SINCE, TOP, MOST, END, OTHER, OTHER_END = range(7)
"""What an input is, and the row since which; the value that it kept longest, for how many rows, and
the row after them; the same of other values."""


def none(inputs: int) -> np.ndarray:
    """No row came yet, (nu, 7)."""
    known = np.zeros((inputs, OTHER_END + 1))
    known[:, [VALUE, TOP]] = np.nan
    return known


@njit(cache=True)
def _end(one: Any, row: int) -> None:
    """What an input was, it is no longer from ``row`` on."""
    rows = row - one[SINCE]
    if one[VALUE] == one[TOP]:
        if rows >= one[MOST]:
            one[MOST], one[END] = rows, row
    elif rows > one[MOST]:
        if one[MOST] > one[OTHER]:
            one[OTHER], one[OTHER_END] = one[MOST], one[END]
        one[TOP], one[MOST], one[END] = one[VALUE], rows, row
    elif rows > one[OTHER]:
        one[OTHER], one[OTHER_END] = rows, row


@njit(cache=True)
def _count(known: Any, row: int, u: Any) -> None:
    for k in range(u.shape[1]):
        one = known[k]
        for i in range(u.shape[0]):
            value = u[i, k]
            if value == value and value != one[VALUE]:
                if one[VALUE] == one[VALUE]:
                    _end(one, row + i)
                one[VALUE], one[SINCE] = value, row + i


def count(known: np.ndarray, row: int, u: Inputs) -> None:
    """More rows, the first of which is ``row``. Writes into ``known``."""
    _count(known, row, np.ascontiguousarray(u))


def handed_on(known: np.ndarray, rows: int) -> np.ndarray:
    """What a run of so many ``rows`` knows, as that of the run after it. Consumes ``known``."""
    for one in known:
        if not np.isnan(one[VALUE]):
            _end(one, rows)
    known[:, VALUE] = np.nan
    known[:, [END, OTHER_END]] -= rows
    return known


def longest(one: Vector, value: float, before: int) -> int:
    """Rows that an input stayed where it was at most, until row ``before``; of a ``value`` that is
    not the one it kept longest, what others were kept."""
    spans = [(one[OTHER], one[OTHER_END])]
    spans += [(one[MOST], one[END])] if value == one[TOP] else []
    return int(max((rows for rows, end in spans if end <= before), default=0))
