"""A number that a recording writes where it has no value: 0, -9999, 65535.

It recurs exactly, each time far off the values on both sides, which agree with each other. What a
machine does in steps (a command, a switch, a motor that is off for a while) does not look so: its
levels are few, or stand for long, or the values beside them differ as much.

>>> way = np.cumsum(np.sin(0.01 * np.arange(400)))
>>> no_value(np.where(np.arange(400) % 7, way, 0.0)), no_value(way)
(0.0, None)
"""

from __future__ import annotations

import numpy as np

from evertwin.types import Vector

SENTINELS = frozenset(
    {-999.0, -9999.0, -99999.0, 9999.0, 99999.0, 32767.0, -32768.0, 65535.0, 2147483647.0,
     -2147483648.0, 4294967295.0}
)  # fmt: skip
"""Usual words for no value: these may stand for long."""
_ROWS = 20_000
_TIMES = 5
"""It has to recur so often."""
_DISTINCT = 30
"""Other values that there have to be."""
_FAR = 4.0
"""Of the usual step, and of what the values on both sides differ by."""
_SHORT = 2.0
"""Rows that it usually stands for."""
_MOSTLY = 0.85
"""Share of the times that all this has to hold: what is written for none may be passed, too."""


def no_value(values: Vector) -> float | None:
    """The number that stands for no value in a column, without its empty cells; None: there is
    none, or it cannot be told from the first rows."""
    values = values[:_ROWS]
    found, counts = np.unique(values, return_counts=True)
    often = found[np.argsort(-counts, kind="stable")][: int(np.sum(counts >= _TIMES))]
    return next((float(one) for one in often[:3] if _stands_for_none(values, one)), None)


def _stands_for_none(values: Vector, one: float) -> bool:
    rest = values[values != one]
    if len(np.unique(rest)) < _DISTINCT:
        return False
    steps = np.abs(np.diff(rest))
    if np.mean(steps > 0.0) < 0.5:
        return False  # levels that are set now and then
    usual = float(np.quantile(steps, 0.98))
    usual = max(usual, 0.01 * float(np.ptp(np.quantile(rest, (0.05, 0.95)))))
    edges = np.diff(np.concatenate([[False], values == one, [False]]).astype(np.int8))
    first, behind = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    inside = (first > 0) & (behind < len(values))
    first, behind = first[inside], behind[inside]
    if len(first) < _TIMES:
        return False
    if round(float(one), 6) not in SENTINELS and np.median(behind - first) > _SHORT:
        return False
    before, after = values[first - 1], values[behind]
    far = np.abs(one - 0.5 * (before + after)) > _FAR * np.maximum(np.abs(after - before), usual)
    return bool(far.mean() >= _MOSTLY)
