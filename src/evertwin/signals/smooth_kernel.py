"""The loop of `evertwin.signals.smooth`, compiled: one fixed order of addition for any cut."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np

__all__ = ["Lines", "slide"]

Array = np.ndarray[Any, Any]


class Lines(NamedTuple):
    """Rows as arrays that share their first axis: those of a block without its number.

    >>> Lines._fields
    ('t', 'dt', 'v', 'mark', 'task', 'gap')
    """

    t: Array
    dt: Array
    v: Array
    """Inputs, then outputs."""
    mark: Array
    task: Array
    gap: Array


@numba.njit(cache=True)
def slide(
    ring: Lines, counters: Array, block: Lines, out: Lines, columns: Array, taps: Array
) -> int:  # pragma: compiled
    """Rows of ``block`` into the ring, rows ``delay`` older into ``out``; how many left.

    ``counters`` holds how many rows have come in and how many of the newest form one even stretch
    without a gap; the last entry of ``taps`` is the nominal period [s].
    """
    window = len(taps) - 1
    period = taps[window]
    m = window // 2
    left = 0
    for i in range(len(block.t)):
        slot = counters[0] % window
        ring.t[slot] = block.t[i]
        ring.dt[slot] = block.dt[i]
        ring.v[slot] = block.v[i]
        ring.mark[slot] = block.mark[i]
        ring.task[slot] = block.task[i]
        ring.gap[slot] = block.gap[i]
        even = abs(block.dt[i] - period) <= 0.5 * period
        follows = counters[0] > 0 and even and not block.gap[i]
        counters[1] = counters[1] + 1 if follows else 1
        counters[0] += 1
        if counters[0] > m:
            at = (counters[0] - 1 - m) % window
            out.t[left] = ring.t[at]
            out.dt[left] = ring.dt[at]
            out.v[left] = ring.v[at]
            out.mark[left] = ring.mark[at]
            out.task[left] = ring.task[at]
            out.gap[left] = ring.gap[at]
            for c in columns:
                total = np.nan
                if counters[1] >= window:
                    total = 0.0
                    for k in range(window):
                        total += taps[k] * ring.v[(counters[0] + k) % window, c]
                if np.isfinite(total):
                    out.v[left, c] = total
                else:
                    out.v[left, c] = np.nan
                    out.mark[left, c] = max(out.mark[left, c], 1)
            left += 1
    return left
