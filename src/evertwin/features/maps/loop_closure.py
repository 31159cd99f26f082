"""Places that were seen again: a keyframe that fits the surroundings of a much earlier one.

The nearer of those that it may have come back to are tried: their surroundings become a map, every
pose in a window around the expected one is looked at, the best is matched point to line. It counts
where it explains most of the keyframe.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from evertwin.features.maps.pose_graph import Edge, turned
from evertwin.features.scans.local_map import KEYFRAMES, Known, Surface, placed
from evertwin.features.scans.registration import explained
from evertwin.features.scans.scan_fit import Expected, balanced, fitted, found_by_search
from evertwin.signals.planar import between
from evertwin.types import Float64

AROUND = 5
"""Keyframes to either side that make up the surroundings of one."""
DRIFT, TWIST = 0.02, 0.004
"""Error that a way brings along: a share of it [m/m], and a turn [rad/m]."""
SURELY, MOST, TURNED = 0.4, 4.0, 0.7
"""Window to either side: at least [m], at most [m], and at most [rad]."""
ALIKE = 0.65
"""Share of a keyframe that must be explained."""
FIRM = np.diag([0.003, 0.003, 0.0007]) ** 2
"""What the surroundings themselves may be off by (m², m², rad²)."""
EVERY = 2
"""Of so many keyframes one is tried."""


def loops(surfaces: Sequence[Surface], poses: Float64[np.ndarray, "n 3"]) -> list[Edge]:
    """Steps between keyframes that are far apart in time and near in place.

    Args:
        surfaces: of each keyframe, in its own frame.
        poses: of each keyframe, as far as known.
    """
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    found = []
    for j in range(KEYFRAMES + AROUND, len(poses), EVERY):
        i = _nearest(poses, way, j)
        if i is not None:
            found += _closed(surfaces, poses, way, (i, j))
    return found


def _nearest(poses: np.ndarray, way: np.ndarray, j: int) -> int | None:
    """The earlier keyframe that this one may have come back to."""
    last = j - KEYFRAMES - AROUND + 1
    off = np.hypot(*(poses[:last, :2] - poses[j, :2]).T)
    reach = np.minimum(SURELY + DRIFT * (way[j] - way[:last]), MOST)
    turn = np.abs(between(poses[:last], np.broadcast_to(poses[j], (last, 3)))[:, 2])
    cost = np.where(off < 2 * reach, off + 0.5 * turn, np.inf)
    i = int(np.argmin(cost))
    return i if math.isfinite(cost[i]) else None


def _closed(
    surfaces: Sequence[Surface], poses: np.ndarray, way: np.ndarray, pair: tuple[int, int]
) -> list[Edge]:
    i, j = pair
    near = range(max(i - AROUND, 0), i + AROUND + 1)
    view = Known.of(np.concatenate([placed(surfaces[k], poses[k]) for k in near]))
    gone = way[j] - way[i]
    window = (min(SURELY + DRIFT * gone, MOST), min(0.1 + TWIST * gone, TURNED))
    some = balanced(surfaces[j])
    start = found_by_search(some, view.points, poses[j], window)
    expected = Expected(poses[j], np.diag([window[0], window[0], window[1]]) ** 2)
    fit = fitted(surfaces[j], view, expected, start)
    if min(fit.share, explained(some, len(some), *view, fit.pose)) < ALIKE:
        return []
    alone = np.linalg.inv(fit.sighting.information + np.eye(3))
    covariance = turned(alone, fit.pose[2]) + FIRM
    return [Edge(i, j, between(poses[i], fit.pose), covariance, loop=True)]
