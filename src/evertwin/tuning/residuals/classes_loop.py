"""The loops behind `evertwin.tuning.residuals.classes`: ranks without sorting, then comparisons.

A quantile needs a few ranks, not an order: values are dealt into buckets of equal width, and only
the buckets that hold a rank are sorted.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit

BINS = 8
"""Classes of an input at most."""
_BUCKETS = 4096
"""At most, so that their counts stay near the processor."""
_SIDE = 4
"""Columns that are read side by side: half a line of the processor's memory."""


@njit(cache=True)
def classify(u: Any, number: Any, count: Any) -> None:
    """Fills the class of each input of ``u`` (n, nu) at each row, ``number`` (nu, n), and the rows
    of each class, ``count`` (nu, BINS)."""
    n, nu = u.shape
    columns = np.empty((_SIDE, n))
    known, work, bucket = np.empty(n), np.empty(n), np.empty(n, np.int32)
    few, limit = np.empty(BINS + 1), np.empty(BINS - 1)
    for j in range(nu):
        if j % _SIDE == 0:
            for i in range(n):
                for side in range(min(_SIDE, nu - j)):
                    columns[side, i] = u[i, j + side]
        column = columns[j % _SIDE]
        m, low, high = 0, np.inf, -np.inf
        for v in column:
            if np.isfinite(v):
                known[m] = v
                m += 1
                low, high = min(low, v), max(high, v)
        different = _distinct(known[:m], few)
        limit[:] = np.inf
        if different > BINS:
            _quantiles(known[:m], low, high, work, bucket, limit)
        else:
            for e in range(1, different):
                limit[e - 1] = (few[e - 1] + few[e]) / 2.0
        _place(column, limit, number[j], count[j])


@njit(cache=True)
def _place(column: Any, limit: Any, number: Any, count: Any) -> None:
    """Fills the class of every row of an input, and the rows of every class."""
    a, b, c, d, e, f, g = limit[0], limit[1], limit[2], limit[3], limit[4], limit[5], limit[6]
    for i in range(len(column)):
        v = column[i]
        number[i] = 0 + (v >= a) + (v >= b) + (v >= c) + (v >= d) + (v >= e) + (v >= f) + (v >= g)
    for k in range(BINS):
        rows = 0
        for i in range(len(column)):
            rows += number[i] == k
        count[k] = rows


@njit(cache=True)
def _quantiles(values: Any, low: float, high: float, work: Any, bucket: Any, limit: Any) -> None:
    """Fills ``limit`` (BINS − 1), each one once, and none at the smallest or largest value."""
    start = _dealt(values, low, high, work, bucket)
    at, before, last = -1, low, len(values) - 1
    for e in range(1, BINS):
        rank = last * (e / BINS)
        first = int(rank)
        at = _sorted_at(work, start, at, first)
        at = _sorted_at(work, start, at, min(first + 1, last))
        q = work[first] + (work[min(first + 1, last)] - work[first]) * (rank - first)
        if before < q < high:
            limit[e - 1] = q
        before = q


@njit(cache=True)
def _distinct(values: Any, few: Any) -> int:
    """Fills ``few`` with the different values, increasing; their number, at most its length."""
    apart = len(values) > BINS
    for i in range(min(len(values), BINS + 1)):
        for k in range(i):
            apart &= values[k] != values[i]
    if apart:
        return BINS + 1
    known = 0
    for v in values:
        at = known
        while at > 0 and few[at - 1] >= v:
            at -= 1
        if at < known and few[at] == v:
            continue
        if known == len(few) - 1:
            return len(few)
        for k in range(known, at, -1):
            few[k] = few[k - 1]
        few[at] = v
        known += 1
    return known


@njit(cache=True)
def _dealt(values: Any, low: float, high: float, work: Any, bucket: Any) -> Any:
    """Fills ``work`` with the values bucket by bucket; where each bucket starts."""
    buckets = min(max(len(values) // 2, 1), _BUCKETS)
    scale = buckets / (high - low)
    if not scale < np.inf:
        scale = 0.0
    start = np.zeros(buckets + 3, np.int32)
    for i in range(len(values)):
        bucket[i] = np.int32((values[i] - low) * scale)
    for i in range(len(values)):
        start[bucket[i] + 2] += 1
    for b in range(buckets + 1):
        start[b + 2] += start[b + 1]
    for i in range(len(values)):
        b = bucket[i] + 1
        work[start[b]] = values[i]
        start[b] += 1
    return start


@njit(cache=True)
def _sorted_at(work: Any, start: Any, last: int, rank: int) -> int:
    """Sorts the bucket that holds a rank, unless it is the ``last`` one that was; the bucket."""
    b = max(last, 0)
    while start[b + 1] <= rank:
        b += 1
    if b == last:
        return b
    part, gap = work[start[b] : start[b + 1]], 1
    while gap < len(part) // 3:
        gap = 3 * gap + 1
    while gap > 0:  # Shell's sort with Knuth's gaps
        for i in range(gap, len(part)):
            v, k = part[i], i
            while k >= gap and part[k - gap] > v:
                part[k] = part[k - gap]
                k -= gap
            part[k] = v
        gap //= 3
    return b
