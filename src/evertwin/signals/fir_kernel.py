"""Compiled: a symmetric filter over columns of which some rows are not known."""

from __future__ import annotations

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import copied
from evertwin.types import Outputs, Vector

LEAST = 0.5
"""Share of the weights that has to fall on known rows."""
TILE = 512
"""Rows that are summed up at once: they stay in the nearest memory."""


@njit(cache=True, error_model="numpy")
def scaled_up(a: Vector, half: Vector, i: int) -> float:
    """Row i where not all rows around it are known: the others count more."""
    total, weight = half[0] * a[i], half[0]
    for k in range(1, half.shape[0]):
        if i >= k and a[i - k] == a[i - k]:
            total += half[k] * a[i - k]
            weight += half[k]
        if i + k < a.shape[0] and a[i + k] == a[i + k]:
            total += half[k] * a[i + k]
            weight += half[k]
    return total / weight if weight >= LEAST else np.nan


@njit(cache=True, error_model="numpy")
def known_run(a: Vector, out: Vector, half: Vector, start: int, stop: int) -> None:
    """Rows ``start`` to ``stop``, all known: whole windows at once, in the order of the weights."""
    delay = half.shape[0] - 1
    first, last = start + delay, stop - delay
    for i in range(start, min(first, stop)):
        out[i] = scaled_up(a, half, i)
    for i in range(max(last, first, start), stop):
        out[i] = scaled_up(a, half, i)
    sums = np.empty(TILE)
    for at in range(first, last, TILE):
        count = min(TILE, last - at)
        for i in range(count):
            sums[i] = half[0] * a[at + i]
        for k in range(1, delay + 1):
            old, new = a[at - k : at - k + count], a[at + k : at + k + count]
            for i in range(count):
                sums[i] += half[k] * (old[i] + new[i])
        copied(out[at : at + count], sums[:count])


@njit(cache=True, error_model="numpy")
def smooth(v: Outputs, half: Vector) -> Outputs:
    """``v`` filtered, (n, k); NaN where it is not known."""
    n, width = v.shape
    out = np.empty((n, width))
    column, filtered = np.empty(n), np.empty(n)
    for c in range(width):
        empty = True  # as columns of links that a joint does not carry are
        for i in range(n):
            column[i], filtered[i] = v[i, c], np.nan
            empty &= column[i] == 0.0
        if empty:
            out[:, c] = 0.0
            continue
        i = 0
        while i < n:
            if column[i] != column[i]:
                i += 1
                continue
            start = i
            while i < n and column[i] == column[i]:
                i += 1
            known_run(column, filtered, half, start, i)
        for i in range(n):
            out[i, c] = filtered[i]
    return out
