"""Spots of a scan: something thin that stands free, such as the leg of a table.

Neighbouring beams that end near each other are one piece. A piece is a spot if it is thin and the
beams on both sides of it end farther away: the sliver of a wall that is seen between two nearer
things is none. A leg shows its near side; its middle lies behind it by π/4 of its radius, which is
the mean depth over where a beam may meet a circle.

>>> ranges = np.full(360, 5.0)
>>> ranges[[90, 91]] = 1.98
>>> found = spots(ranges, Lidar(-np.pi, np.radians(1.0), 20.0))
>>> found.place.round(2).tolist(), found.radius.round(3).tolist()
([[0.02, -2.0]], [0.025])
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.sources.columns.scans import Lidar
from evertwin.types import Float64, Vector

WIDEST = 0.16
"""Width of the widest leg [m]."""
JUMP = 0.1
"""From which difference of their ranges on neighbouring beams meet different things [m]."""
FREE = 0.12
"""By how much what lies on both sides of a leg is farther away, at least [m]."""
RADIUS = 0.025
"""Of a leg that too few beams meet to tell it [m]."""
ENOUGH = 3
"""Beams that tell a radius."""
ROUND = np.pi / 4
RADIAL, LATERAL = 0.012, 0.005
"""What a leg's shape adds to the spread of its middle along and across the beam [m]."""
NOISE = 0.01
"""Standard deviation of a range [m]."""


class Spots(NamedTuple):
    """Spots of one scan, in the lidar's frame.

    >>> Spots._fields
    ('place', 'radius', 'covariance')
    """

    place: Float64[np.ndarray, "m 2"]
    """Middle [m]."""
    radius: Vector
    """[m]"""
    covariance: Float64[np.ndarray, "m 2 2"]
    """Of the middle."""


def spots(ranges: Vector, lidar: Lidar) -> Spots:
    """The spots of a scan.

    Args:
        ranges: of each beam [m]; NaN where nothing came back.
        lidar: where the beams look.
    """
    beams = len(ranges)
    far = np.where(np.isfinite(ranges), ranges, np.inf)
    with np.errstate(invalid="ignore"):
        breaks = ~(np.abs(np.diff(far)) <= JUMP)
    first = np.flatnonzero(np.r_[True, breaks])
    last = np.r_[first[1:], beams] - 1
    around = abs(lidar.step) * beams > 2 * np.pi - 1.5 * abs(lidar.step)
    before, after = np.roll(far, 1), np.roll(far, -1)
    if not around:  # what lies beyond the outermost beams is not known
        before[0] = after[-1] = -np.inf
    near, count = far[first], last - first + 1
    thin = np.isfinite(near)
    near = np.where(thin, near, 0.0)
    thin &= (count - 1) * abs(lidar.step) * near <= WIDEST
    thin &= (before[first] > near + FREE) & (after[last] > far[last] + FREE)
    first, last, count = first[thin], last[thin], count[thin]
    sums = np.r_[0.0, np.cumsum(np.where(np.isfinite(far), far, 0.0))]
    r = (sums[last + 1] - sums[first]) / count
    wide = abs(lidar.step) * r
    radius = np.where(count >= ENOUGH, np.minimum(0.5 * count * wide, 0.5 * WIDEST), RADIUS)
    angle = lidar.start + lidar.step * 0.5 * (first + last)
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    across = np.column_stack([-along[:, 1], along[:, 0]])
    radial = NOISE * NOISE / count + RADIAL * RADIAL
    lateral = np.minimum(wide, 2 * radius) ** 2 / 12 + LATERAL * LATERAL
    covariance = radial[:, None, None] * along[:, :, None] * along[:, None]
    covariance += lateral[:, None, None] * across[:, :, None] * across[:, None]
    return Spots((r + ROUND * radius)[:, None] * along, radius, covariance)
