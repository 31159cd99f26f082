"""A whole recording of scans to poses: followed, its loops closed, every scan put in its place.

Following is a fold; closing loops is slow work on what it left: the keyframes. Twice, because what
the first round has straightened is recognised better in the second.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.features.local_map import Surface, seen
from evertwin.features.loop_closure import loops
from evertwin.features.pose_graph import Edge, Optimised, optimised, turned, variance_factor, weak
from evertwin.features.poses import Fix, Poses
from evertwin.features.scan_matcher import ScanMatcher
from evertwin.fold import join, make_block, take
from evertwin.signals.planar import between, compose
from evertwin.sources.scans import Scans
from evertwin.types import Float64, Vector

ROUNDS = 2
"""Of looking for loops."""
SURE = 0.2
"""Spread below which a place is sure [m]."""


class Followed(NamedTuple):
    """Poses as a stream tells them.

    >>> Followed._fields
    ('poses', 'took')
    """

    poses: Poses
    took: Vector
    """Time for each scan [s]."""


class Mapped(NamedTuple):
    """Poses of a recording.

    >>> Mapped._fields
    ('poses', 'keyframes', 'surfaces', 'loops', 'took')
    """

    poses: Poses
    """In one frame per segment; covariance relative to its first scan."""
    keyframes: Float64[np.ndarray, "k 3"]
    surfaces: tuple[Surface, ...]
    """Of each keyframe, in its own frame."""
    loops: int
    """Places that were recognised."""
    took: Vector
    """Time for following each scan [s]."""


def followed(scans: Scans, use_odometry: bool = True) -> Followed:
    """The poses of a recording as a stream tells them, scan by scan, without looking back."""
    n, beams = scans.ranges.shape
    moved = motion_at(scans) if use_odometry else np.zeros((n, 0))
    block = make_block(t=scans.t, u=moved, y=scans.ranges)
    matcher, outs, took = ScanMatcher(scans.lidar, beams), [], np.zeros(n)
    state = matcher.init()
    for i in range(n):
        began = time.perf_counter()
        state, out = matcher.step(state, take(block, i, i + 1))
        took[i] = time.perf_counter() - began
        outs.append(out)
    return Followed(join(outs).rows, took)


def motion_at(scans: Scans) -> Float64[np.ndarray, "n _"]:
    """The wheels' pose at each scan, and the gyro's angle; no column where there is neither."""
    n = len(scans.t)
    wheels = np.full((n, 3), np.nan) if scans.odometry is None else scans.odometry
    if scans.gyro is None:
        return np.zeros((n, 0)) if scans.odometry is None else wheels
    t, rate = scans.gyro.t, scans.gyro.values[:, 0]
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t) * 1e-9
    angle = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.interp((scans.t - t[0]) * 1e-9, (t - t[0]) * 1e-9, angle, np.nan, np.nan)
    return np.column_stack([wheels, at])


def mapped(scans: Scans, use_odometry: bool = True) -> Mapped:
    """The poses of a recording, its loops closed.

    Raises:
        DataError: no scan tells a pose.
        MissingExtra: GTSAM is not installed.
    """
    poses, took = followed(scans, use_odometry)
    poses = _evened(poses)
    keys = np.flatnonzero(poses.keyframe & (poses.fix != Fix.LOST) & (poses.segment == 0))
    if not len(keys):
        raise DataError(f"{scans.name}: no scan tells a pose: does the lidar see anything?")
    surfaces = tuple(surface_of(scans, int(k)) for k in keys)
    steps = _steps(poses, keys)
    graph = Optimised(poses.pose[keys], poses.covariance[keys])
    found: list[Edge] = []
    for _ in range(ROUNDS):
        found = loops(surfaces, graph.poses)
        graph = optimised(graph.poses, [*steps, *found])
    factor = variance_factor(poses.pose[keys], steps, found)
    steps = [
        edge if weak(edge) else edge._replace(covariance=factor * edge.covariance) for edge in steps
    ]
    graph = optimised(graph.poses, [*steps, *found])
    return Mapped(_all(poses, keys, graph), graph.poses, surfaces, len(found), took)


def surface_of(scans: Scans, k: int) -> Surface:
    """The surface points of one scan, in the machine's frame."""
    return seen(scans.ranges[k], scans.lidar.angles(scans.ranges.shape[1]), scans.lidar.mount)


def _steps(poses: Poses, keys: Sequence[int] | np.ndarray) -> list[Edge]:
    """From each keyframe to the next, as they were followed."""
    out = []
    for n, (a, b) in enumerate(pairwise(keys)):
        covariance = turned(poses.covariance[b], poses.pose[b, 2])
        out.append(Edge(n, n + 1, between(poses.pose[a], poses.pose[b]), covariance))
    return out


def _evened(poses: Poses) -> Poses:
    """Poses whose place was not sure (in a bare corridor), moved by what the next sure one tells.

    There the way comes in one leap; every scan since the last sure one takes an equal share of it.
    """
    pose = poses.pose.copy()
    told = np.flatnonzero(poses.fix == Fix.MATCHED)
    spread = np.trace(poses.covariance[told, :2, :2], axis1=1, axis2=2)
    firm = told[spread < SURE * SURE]
    for a, b in pairwise(firm):
        between_them = told[(told > a) & (told < b)]
        if len(between_them) > 1 and poses.segment[a] == poses.segment[b]:
            before, last = between_them[-2:]
            usual = (pose[last, :2] - pose[before, :2]) / (last - before) * (b - last)
            leap = pose[b, :2] - pose[last, :2] - usual
            pose[between_them, :2] += (between_them - a)[:, None] / (b - a) * leap
    return poses._replace(pose=pose)


def _all(poses: Poses, keys: np.ndarray, graph: Optimised) -> Poses:
    """Every scan beside the keyframe before it."""
    at = np.maximum(np.searchsorted(keys, np.arange(len(poses.t)), side="right") - 1, 0)
    step = between(poses.pose[keys[at]], poses.pose)
    pose = compose(graph.poses[at], step)
    covariance = graph.covariances[at] + poses.covariance
    mine = (poses.segment == 0)[:, None]
    return poses._replace(
        pose=np.where(mine, pose, poses.pose),
        covariance=np.where(mine[..., None], covariance, poses.covariance),
    )
