"""Compiled: a few rows of what goes steadily as a position does, that cannot be its own.

What it does from one row to the next is compared with the fastest that it ever did. Rows that leave
it far faster and come back as fast are wrong: they are taken from their neighbours. Where it goes
on from there as it ever went, its zero moved.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.types import Vector

if TYPE_CHECKING:
    from evertwin.sync.alignment.derive_loop import Lines

KNOWN, FAR, NEAR, LONGEST = 50, 4.0, 1.5, 3
"""Of what goes steadily: rows at which it moved before it is known how fast it does, times of that
from which a step is none of its own, times within which it is back, and rows that may be wrong."""
LEAPT = 7
"""Mark of a row up to which what goes steadily leapt."""
OK, ERROR = 0, 6


@njit(cache=True, error_model="numpy")
def speed(ring: Lines, i: int, from_: float, j: int, to: float) -> float:
    """From a value at place i to one at place j; NaN without an interval."""
    passed = (ring.t[j] - ring.t[i]) * 1e-9
    return (to - from_) / passed if passed > 0.0 else np.nan


@njit(cache=True, error_model="numpy")
def astray(ring: Lines, at: int, c: int, last: float, rows: int, fastest: float) -> int:
    """Rows from place ``at`` on that leave what was before far faster than it ever went, and come
    back as fast; −1: it goes on from there as it ever went; 0: neither.

    Args:
        last: the value before.
        rows: that are known from ``at`` on.
    """
    depth = ring.t.shape[0]
    before = (at - 1) % depth
    away = speed(ring, before, last, at, ring.v[at, c])
    if not abs(away) > FAR * fastest:
        return 0
    on = 0
    for m in range(1, min(LONGEST, rows - 1) + 1):
        end, behind = (at + m - 1) % depth, (at + m) % depth
        back = speed(ring, end, ring.v[end, c], behind, ring.v[behind, c])
        whole = speed(ring, before, last, behind, ring.v[behind, c])
        if back * away < 0.0 and abs(back) > FAR * fastest and abs(whole) <= NEAR * fastest:
            return m
        on += abs(back) <= NEAR * fastest
    return -1 if on == LONGEST else 0


@njit(cache=True, error_model="numpy")
def steadily(
    ring: Lines, base: int, c: int, own: int, j: int, n: int, sums: Vector
) -> tuple[float, int]:
    """What goes steadily at row j of n, and its mark: `ERROR` where it is taken from its
    neighbours; column ``own`` has what was told of the rows before."""
    depth = ring.t.shape[0]
    at, before = (base + j) % depth, (base + j - 1) % depth
    value = ring.v[at, c]
    if j == 0:
        sums[2], sums[3] = 0.0, 0.0
        return value, OK
    last, passed = ring.v[before, own] + sums[3], (ring.t[at] - ring.t[before]) * 1e-9
    if sums[2] == 0.0 and sums[0] >= KNOWN:
        rows = astray(ring, at, c, last, n - j, sums[1])
        if rows < 0:
            behind = (at + 1) % depth
            went = last + speed(ring, at, value, behind, ring.v[behind, c]) * passed
            sums[3] += value - went
            return value - sums[3], LEAPT
        sums[2] = rows
    if sums[2] > 0.0:
        behind = (at + int(sums[2])) % depth
        sums[2] -= 1.0
        slope = speed(ring, before, last, behind, ring.v[behind, c])
        return last + slope * passed - sums[3], ERROR
    went = abs(speed(ring, before, last, at, value))
    if went > 0.0 and went < np.inf:
        sums[1] = max(sums[1], went if sums[0] < KNOWN else min(went, 2.0 * sums[1]))
        sums[0] += 1.0
    return value - sums[3], OK
