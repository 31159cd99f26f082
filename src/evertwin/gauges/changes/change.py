"""When a machine changed within a window: rows before that are of another machine.

A fit over both tells neither. Proposed is the place that splits the residuals of the version as it
is into two parts of different size most clearly (likelihood ratio of two exponential distributions
of the mean squares of blocks of rows, summed over outputs). A motion that is harder to predict
looks the same, so a place counts only if a fit to the rows behind it does worse before it, and
there, where the inputs had been before, nearly as well as the version did: no version holds for
both, and the form holds for either. Where play or friction holds a machine back, what it does goes
by how far its inputs swing, too: rows are compared with rows before at which they swung as far, and
a rise that is left to those at which they swing as they had not before tells of no change.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from evertwin.fold import Block, Windows, take
from evertwin.gauges.rows.gauge_rows import residual, unchanged
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.gauges.rows.settled import settled
from evertwin.tuning import Fit, Problem
from evertwin.tuning.posing.recordings import beginning
from evertwin.types import Inputs, Outputs, PerOutput, Vector

BLOCKS, ROWS = 384, 10
"""Blocks of a window at most, rows of one at least: neighbouring rows are alike."""
CLEAR = 4.0
"""Logarithm of the likelihood ratio from which on a place is looked at."""
PART = 0.25
"""Share by which the mean square before the place rises at least by the fit to the rows behind."""
RESTORED = 0.7
"""Share of the rise at the place that this fit has to take back."""
BINS = 20
"""Parts of an input's range that count as one place, or as one swing."""
SWING, COMMON, FEW = 20, 0.5, 0.25
"""Swings are of so many-th a part of the rows before the place; part of the rise that stays where
inputs swing as they had before, at least; and part of the rows at which they do, at least."""
LIKE, OFTEN = 10, 100
"""Classes of rows by how far inputs swing, at most, and rows before the place for each: rows are
compared with those before of their own class."""


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
    """Position from which on the residual is larger, the likeliest; 0: none is likely,
    or there are fewer rows than two blocks.

    >>> noise = np.random.default_rng(0).normal(size=(480, 1))
    >>> likely(noise), likely(np.concatenate([noise[:360], 3 * noise[360:]]))
    (0, 360)
    """
    size = max(len(residual) // BLOCKS, ROWS)
    m = len(residual) // size
    if m < 2:
        return 0
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
    best = int(np.argmax(gain))
    return len(residual) - (m - best - 1) * size if gain[best] > CLEAR else 0


@unmeasured()
def suddenly(
    windows: Windows, pose: Callable[[Windows], Problem], *, common: bool = True
) -> Windows:
    """The rows behind the place from which on the residual is larger; none where there is no such
    place. Whether it is the machine that changed there is for a search on them to tell.

    Args:
        windows: rows, in order.
        pose: the problem on some of them; it starts at the version as it is.
        common: has it to be larger where inputs swing as far as before, too?
    """
    whole = pose(windows)
    left = unchanged(whole)
    place = likely(left)
    if not place or (common and not _rises(left, whole.rows.u, place)):
        return ()
    return split(windows, place)[1]


@unmeasured()
def changed(windows: Windows, pose: Callable[[Windows], Problem]) -> int:
    """Position of the first row of the machine as it is now; 0: it is the same in all rows.

    Args:
        windows: rows, in order.
        pose: the problem on some of them; it starts at the version as it is.
    """
    whole = pose(windows)
    off = unchanged(whole)
    place = likely(off)
    if not place or not _rises(off, whole.rows.u, place):
        return 0
    old, new = split(windows, place)
    values, half = _numbers(whole, settled(pose(new)))
    if not len(whole.model.states):
        was, about = _numbers(whole, settled(pose(old)))
        sure = np.hypot(half, np.where(np.isfinite(about), about, 0.0))
        if not (np.abs(values - was) > sure).any():  # chance tells as much
            return 0
    start, fit = (np.square(residual(whole, v)) for v in (whole.start, values))
    size = _mean(start)
    # the row from which on the fit is the better one, summed over all rows
    place = 1 + int(np.argmin(np.cumsum(np.nansum((start - fit) / size, axis=1))))
    now = slice(place, None)
    if not _rises(residual(whole, whole.start), whole.rows.u, place):
        return 0
    alike, known = _alike(whole.rows.u, place)
    known &= _seen(whole.rows.u, place)
    before, worse = (_mean(one[:place], alike) for one in (start, fit))
    after, left = (_mean(one[now][known]) for one in (start, fit))
    rise = float(np.nansum((after - before) / before))
    explained = float(np.nansum((after - left) / before))
    both = float(np.nansum((worse - before) / before)) <= PART
    return place if 0.0 < RESTORED * rise <= explained and not both else 0


def _numbers(whole: Problem, fit: Fit) -> tuple[Vector, Vector]:
    """The machine's numbers as a fit to some of the rows tells them, the others as they were; and
    half their 95 % intervals."""
    values, half = whole.start.copy(), np.full(len(whole.start), np.inf)
    begins = beginning(whole.model, whole.names)  # of the first rows
    wide = np.diff(fit.interval95, axis=1)[:, 0] / 2.0
    for name, value, width in zip(fit.names, fit.values, wide, strict=True):
        if name in whole.names and name not in begins:
            values[whole.names.index(name)], half[whole.names.index(name)] = value, width
    return values, half


def _rises(residual: Outputs, u: Inputs, place: int) -> bool:
    """Is the residual larger from ``place`` on where inputs swing as far as they had before?"""
    squares, (alike, known) = np.square(residual), _alike(u, place)
    if known.mean() < FEW:
        return False
    old, new = squares[:place], squares[place:]
    pairs = (_mean(old, alike), _mean(new[known])), (_mean(old), _mean(new))
    rise, whole = (float(np.nansum((after - before) / before)) for before, after in pairs)
    return rise >= COMMON * whole


def _alike(u: Inputs, place: int) -> tuple[Vector, np.ndarray]:
    """Weights of the rows before ``place`` by which inputs swing as far there as they do on the
    rows behind it that are known, (place,), and these, (n − place,)."""
    share, kinds = _swings(u, place), min(max(place // OFTEN, 1), LIKE)
    kind = np.minimum(kinds * share, kinds).astype(int)
    count = np.bincount(kind[:place], minlength=kinds + 1)
    enough = count >= ROWS
    enough[kinds] = False  # farther than ever before
    known = enough[kind[place:]]
    wanted = np.bincount(kind[place:][known], minlength=kinds + 1)
    return (np.where(enough, wanted, 0.0) / np.maximum(count, 1))[kind[:place]], known


def swings_alike(before: Windows, now: Windows) -> bool:
    """Do inputs swing no farther in half of these rows than they had before? Where there are fewer
    rows before nobody knows, and they do not."""
    u = [np.concatenate([block.u for block in some]) for some in (before, now)]
    place = len(u[0])
    if place < len(u[1]):
        return True
    return bool(swung(np.concatenate(u), place).mean() >= COMMON)


def swung(u: Inputs, place: int) -> np.ndarray:
    """Rows from ``place`` on up to which inputs swung no farther than before that: elsewhere the
    form may be wrong, which looks the same as a change.

    >>> u = np.repeat([1.0, -1.0] * 20 + [3.0, -3.0] * 10, 20)[:, None]
    >>> bool(swung(u[:800], 400).all()), bool(swung(u, 800).any())
    (True, False)
    """
    return np.asarray(_swings(u, place)[place:] < 1.0)


def _swings(u: Inputs, place: int) -> Vector:
    """How far inputs swing up to each row, of the farthest before ``place`` and a bin more: the one
    that swings the farthest by that, (n,)."""
    span = max(place // SWING, ROWS)
    back = (span - 1) // 2  # of the rows up to each
    least = np.where(np.isfinite(u), u, np.inf).min(axis=0)
    filled = np.where(np.isfinite(u), u, np.where(np.isfinite(least), least, 0.0))
    low, high = (
        some(filled, span, axis=0, origin=back, mode="nearest")
        for some in (scipy.ndimage.minimum_filter1d, scipy.ndimage.maximum_filter1d)
    )
    wide, usual = high - low, (1.0 + 1.0 / BINS) * (high - low)[:place].max(axis=0)
    share = np.where(usual > 0.0, wide / np.where(usual > 0.0, usual, 1.0), wide > 0.0)
    return np.asarray(share.max(axis=1, initial=0.0))


def _seen(u: Inputs, place: int) -> np.ndarray:
    """Rows from ``place`` on whose inputs had been where they are."""
    low = np.nanmin(u, axis=0)
    wide = np.nanmax(u, axis=0) - low
    bins = np.nan_to_num((u - low) / np.where(wide > 0.0, wide, 1.0) * BINS).astype(int)
    known = np.ones(len(u) - place, dtype=np.bool_)
    for column in bins.T:
        known &= np.isin(column[place:], column[:place])
    return known


def _mean(squares: Outputs, weights: Vector | None = None) -> PerOutput:
    """Per output, over the rows that count; NaN where none does."""
    by = np.isfinite(squares) * (1.0 if weights is None else weights[:, None])
    rows = by.sum(axis=0)
    return np.asarray(np.nansum(squares * by, axis=0) / np.where(rows > 0.0, rows, np.nan))
