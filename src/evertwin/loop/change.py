"""When a machine changed within a window: rows before that are of another machine.

A fit over both tells neither. Proposed is the place that splits the residuals of the version as it
is into two parts of different size most clearly (likelihood ratio of two exponential distributions
of the mean squares of blocks of rows, summed over outputs). A motion that is harder to predict
looks the same, so a place counts only if a fit to the rows behind it does better there and worse
before it: no version holds for both.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from evertwin.fold import Block, take
from evertwin.tuning import Problem, solve
from evertwin.types import Outputs, PerOutput, Vector

BLOCKS, ROWS = 384, 10
"""Blocks of a window at most, rows of one at least: neighbouring rows are alike."""
CLEAR = 4.0
"""Logarithm of the likelihood ratio from which on a place is looked at."""
PART = 0.25
"""Share by which the mean square has to fall behind the place, and to rise before it."""
Windows = tuple[Block, ...]


def split(windows: Windows, place: int) -> tuple[Windows, Windows]:
    """The rows before position ``place`` of all rows, and those from it on.

    >>> from evertwin.fold import make_block
    >>> rows = make_block(t=range(4), u=np.zeros((4, 1)), y=np.zeros((4, 1)))
    >>> [[len(block.t) for block in side] for side in split((rows, rows), 5)]
    [[4, 1], [3]]
    """
    before, after, at = list[Block](), list[Block](), 0
    for block in windows:
        n, cut = len(block.t), min(max(place - at, 0), len(block.t))
        before += [take(block, 0, cut)] if cut else []
        after += [take(block, cut, n)] if cut < n else []
        at += n
    return tuple(before), tuple(after)


def likely(residual: Outputs) -> int:
    """Position from which on the residual is larger, the likeliest; 0: none is likely.

    >>> noise = np.random.default_rng(0).normal(size=(480, 1))
    >>> likely(noise), likely(np.concatenate([noise[:360], 3 * noise[360:]]))
    (0, 360)
    """
    size = max(len(residual) // BLOCKS, ROWS)
    m = len(residual) // size
    squares = np.square(residual[len(residual) - m * size :]).reshape(m, size, -1)
    rows = np.count_nonzero(np.isfinite(squares), axis=1)
    sums = np.nansum(squares, axis=1)
    left, count = np.cumsum(sums, axis=0)[:-1], np.cumsum(rows, axis=0)[:-1]
    total, n = sums.sum(axis=0), rows.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        whole, low = np.log(total / n), np.log(left / count)
        high = np.log((total - left) / (n - count))
        gain = (n * whole - count * low - (n - count) * high) / (2 * size)
    gain = np.where((high > low) & np.isfinite(gain), gain, 0.0).sum(axis=1)
    best = int(np.argmax(gain)) if len(gain) else 0
    return len(residual) - (m - best - 1) * size if len(gain) and gain[best] > CLEAR else 0


def changed(windows: Windows, pose: Callable[[Windows], Problem]) -> int:
    """Position of the first row of the machine as it is now; 0: it is the same in all rows.

    Args:
        windows: rows, in order.
        pose: the problem on some of them; it starts at the version as it is.
    """
    whole = pose(windows)
    place = likely(_residuals(whole, whole.start))
    if not place:
        return 0
    old, new = map(pose, split(windows, place))
    values = solve(new).values
    sizes = np.sqrt(_mean_squares(whole, whole.start))
    worse, better = (
        float(np.nansum(_mean_squares(part, values) / sizes**2))
        / float(np.nansum(_mean_squares(part, part.start) / sizes**2))
        for part in (old, new)
    )
    if worse <= 1.0 + PART or better >= 1.0 - PART:
        return 0
    # the row from which on the fit is the better one, summed over all rows
    before, after = (np.square(_residuals(whole, v) / sizes) for v in (whole.start, values))
    return 1 + int(np.argmin(np.cumsum(np.nansum(before - after, axis=1))))


def _residuals(problem: Problem, values: Vector) -> Outputs:
    """NaN where a row does not count."""
    return np.where(problem.rows.used, problem.residuals(values), np.nan)


def _mean_squares(problem: Problem, values: Vector) -> PerOutput:
    """Per output, over the rows that count; NaN where none does."""
    residual = _residuals(problem, values)
    rows = np.count_nonzero(np.isfinite(residual), axis=0)
    return np.asarray(np.nansum(np.square(residual), axis=0) / np.where(rows, rows, np.nan))
