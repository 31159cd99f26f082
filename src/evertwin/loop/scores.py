"""The scores of the loop: one compiled pass over released rows.

For each row: deviations of the champion and of the first champion, all and moving, and the paired
loss of champion and challenger, which is handed on where a segment ends.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from evertwin.loop.deviation import new_sums
from evertwin.loop.released import Released
from evertwin.loop.twin_state import Scores

__all__ = ["accumulate", "new_scores"]


def new_scores(outputs: int, updates: np.ndarray, row: int, scale: np.ndarray) -> Scores:
    """Empty scores, as at the start and at each change of champion."""
    watch, live, first, live_moving, first_moving = (new_sums(outputs) for _ in range(5))
    return Scores(watch, live, first, live_moving, first_moving, updates, row, np.zeros(3), scale)


@njit(cache=True)
def _accumulate(rows: Any, sums: Any, pair: Any, scale: Any, pairs: Any) -> int:
    measured, live, first, other, moving, end = rows
    count = 0
    for i in range(live.shape[0]):
        for k in range(live.shape[1]):
            y, a, b, c = measured[i, k], live[i, k], first[i, k], other[i, k]
            for s in range(5):
                r = b if s == 2 or s == 4 else a
                if r != r or ((s == 0 or s >= 3) and not moving[i, k]):
                    continue
                sums[s][0][k] += r * r
                sums[s][1][k] += y * y
                sums[s][2][k] += 1
            if a == a and c == c:
                pair[0] += (a / scale[k]) * (a / scale[k])
                pair[1] += (c / scale[k]) * (c / scale[k])
                pair[2] += 1.0
        if end[i] and pair[2] > 0.0:
            pairs[count, 0] = pair[0] / pair[2]
            pairs[count, 1] = pair[1] / pair[2]
            count += 1
        if end[i]:
            pair[:] = 0.0
    return count


def accumulate(scores: Scores, rows: Released) -> tuple[Scores, np.ndarray]:
    """The scores with more rows, and the paired losses of the segments that ended, (m, 2).

    Consumes ``scores``. A loss is the mean of (residual / scale)² over the segment's rows and
    outputs at which both versions have one.
    """
    pairs = np.empty((int(np.count_nonzero(rows.end)), 2))
    sums = (scores.watch, scores.live, scores.first, scores.live_moving, scores.first_moving)
    count = _accumulate(rows[3:], tuple(tuple(s) for s in sums), scores.pair, scores.scale, pairs)
    return scores, pairs[:count]
