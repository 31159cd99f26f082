"""The surface points of the newest keyframes: a ring of fixed capacity.

>>> ring = empty(beams=4)
>>> ring = joined(ring, np.array([[1.0, 0.0, -1.0, 0.0]]), np.array([2.0, 0.0, np.pi / 2]))
>>> known(ring).points.round(6).tolist()
[[2.0, 1.0, -0.0, -1.0]]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.features.scans.registration import BUCKETS, binned
from evertwin.features.scans.surface import surface
from evertwin.types import Float64, Int64, Vector

KEYFRAMES = 20
"""Scans in the map."""

POINTS = 240
"""Points of a scan that are used, at most."""

Surface = Float64[np.ndarray, "_ 4"]
"""x, y [m] and the wall's normal; a zero normal where there is no wall."""


class LocalMap(NamedTuple):
    """Points by keyframe, in the frame of the map.

    >>> LocalMap(np.zeros((2, 3, 4)), np.zeros(2, np.int64), np.zeros(3), 0).joined
    0
    """

    points: Float64[np.ndarray, "slots beams 4"]
    counts: Int64[np.ndarray, " slots"]
    newest: Float64[np.ndarray, " 3"]
    """Pose of the newest keyframe."""
    joined: int
    """Keyframes so far."""


class Known(NamedTuple):
    """Points of a map, in bins; see `evertwin.features.scans.registration.binned`.

    >>> Known.of(np.zeros((0, 4))).heads[-1]
    np.int64(0)
    """

    points: Surface
    heads: Int64[np.ndarray, " buckets"]
    order: Int64[np.ndarray, " _"]

    @classmethod
    def of(cls, points: Surface) -> Known:
        """The bins of ``points``."""
        heads, order = np.zeros(BUCKETS + 1, np.int64), np.zeros(len(points), np.int64)
        binned(points, len(points), heads, order)
        return cls(points, heads, order)


def empty(beams: int) -> LocalMap:
    """A map without keyframes, for scans of so many beams."""
    counts = np.zeros(KEYFRAMES, np.int64)
    return LocalMap(np.zeros((KEYFRAMES, min(beams, POINTS), 4)), counts, np.zeros(3), 0)


def seen(ranges: Vector, angles: Vector, mount: tuple[float, float, float]) -> Surface:
    """The surface points of a scan, in the machine's frame.

    >>> wall = 2 / np.cos(np.linspace(-0.4, 0.4, 41))
    >>> seen(wall, np.linspace(-0.4, 0.4, 41), (0.5, 0.0, np.pi))[20].round(6).tolist()
    [-1.5, 0.0, 1.0, -0.0]
    """
    found = np.zeros((len(ranges), 4))
    points = thinned(found[: surface(ranges, angles, found)])
    return placed(points, np.array(mount)) if any(mount) else points


def thinned(points: Surface) -> Surface:
    """At most `POINTS` of a scan, evenly over its beams."""
    return points[:: -(-len(points) // POINTS)] if len(points) > POINTS else points


def placed(points: Surface, pose: Float64[np.ndarray, " 3"]) -> Surface:
    """Points of a scan as they stand in the map that ``pose`` is told in."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y, nx, ny = points.T
    return np.column_stack(
        [c * x - s * y + pose[0], s * x + c * y + pose[1], c * nx - s * ny, s * nx + c * ny]
    )


def joined(ring: LocalMap, points: Surface, pose: Float64[np.ndarray, " 3"]) -> LocalMap:
    """The map with a keyframe more, in place of the oldest. Consumes ``ring``."""
    slot = ring.joined % len(ring.counts)
    ring.points[slot, : len(points)] = placed(points, pose)
    ring.counts[slot] = len(points)
    return LocalMap(ring.points, ring.counts, pose.copy(), ring.joined + 1)


def known(ring: LocalMap) -> Known:
    """Its points in bins, in the order of the slots."""
    slots = zip(ring.points, ring.counts, strict=True)
    return Known.of(np.concatenate([points[:count] for points, count in slots]))


def copied(ring: LocalMap) -> LocalMap:
    """A local map that another reading may write into."""
    return ring._replace(points=ring.points.copy(), counts=ring.counts.copy())
