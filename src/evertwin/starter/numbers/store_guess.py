"""What a recording says, roughly, of a store that fills and leaks: where its model starts from."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.types import Vector

BINS = 4000
"""Means over equal times that a recording is looked at by."""
LEAKS = 32
"""Tried, from a third of one per recording to a third of one per bin."""


class Store(NamedTuple):
    """Numbers of dy/dt = gain u − leak y + constant, in SI units.

    >>> Store(2.0, 0.5, 0.0).gain
    2.0
    """

    gain: float
    leak: float
    constant: float


UNKNOWN = Store(1.0, 1.0, 0.0)


def guess_store(t: Vector, u: Vector, y: Vector) -> tuple[Store, float]:
    """The store whose free run is nearest to a recording, of `LEAKS` leaks, and the mean square by
    which it is off.

    Of each leak the rest is linear: what the input and a constant fill, and the level at the start.

    Args:
        t: time of each row [s], (n,), rising.
        u: what fills, (n,).
        y: the level, (n,).

    >>> t = np.arange(400) * 0.5
    >>> u = (t % 60 < 30) * 2.0
    >>> y = scipy.signal.lfilter([0.0, 0.25], [1.0, -0.95], u) + 20.0
    >>> found, _ = guess_store(t, u, y)
    >>> f"{found.gain:.1f} {found.leak:.1f} {found.constant:.0f}"
    '0.5 0.1 2'
    """
    known = np.isfinite(t) & np.isfinite(u) & np.isfinite(y)
    t, u, y = t[known], u[known], y[known]
    span = float(t[-1] - t[0]) if len(t) > 1 else 0.0
    bins = min(BINS, len(t))
    if not span > 0.0 or bins < 8 or not np.ptp(u) > 0.0:
        return UNKNOWN, math.inf
    place = np.minimum(((t - t[0]) * (bins / span)).astype(int), bins - 1)
    rows = np.maximum(np.bincount(place, minlength=bins), 1e-9)
    held = np.maximum.accumulate(np.where(rows >= 1.0, np.arange(bins), 0))  # a bin without rows
    u, y = ((np.bincount(place, one, bins) / rows)[held] for one in (u, y))
    step, found, least = span / bins, UNKNOWN, np.inf
    for leak in np.geomspace(0.3 / span, 0.3 / step, LEAKS):
        rest = np.exp(-leak * step)
        into, filter_ = np.array([u, np.ones(bins)]), ([0.0, (1.0 - rest) / leak], [1.0, -rest])
        columns = np.column_stack([*scipy.signal.lfilter(*filter_, into), rest ** np.arange(bins)])
        size = np.linalg.norm(columns, axis=0) + 1e-300
        numbers = np.linalg.lstsq(columns / size, y, rcond=None)[0] / size
        off = float(np.square(columns @ numbers - y).mean())
        if off < least:
            found, least = Store(float(numbers[0]), float(leak), float(numbers[1])), off
    return found, least
