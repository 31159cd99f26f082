"""A whole recording of scans to poses: followed, its loops closed, every scan put in its place.

Following is a fold; closing loops is slow work on what it left: the keyframes. Twice, because what
the first round has straightened is recognised better in the second.
"""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.features.fusion import Belief, Sighting
from evertwin.features.local_map import Surface, seen
from evertwin.features.look_ahead import read_on
from evertwin.features.loop_closure import loops
from evertwin.features.occupancy import of_keyframes
from evertwin.features.open_ways import evened, steps_between
from evertwin.features.pose_graph import Edge, Optimised, optimised, variance_factor, weak
from evertwin.features.poses import Fix, Poses
from evertwin.features.relocalisation import PASSED, View, located, through
from evertwin.features.scan_fit import COMMON
from evertwin.features.scan_matcher import FAMILIAR, ScanMatcher, table
from evertwin.features.stream import Stream, Turned
from evertwin.features.troubles import (
    ASKEW,
    askew,
    mirrored,
    overturned,
    scaled,
    troubles,
    without_body,
)
from evertwin.fold import join, make_block, take
from evertwin.signals.planar import between, compose
from evertwin.sources.scans import Lidar, Scans
from evertwin.types import Float64, Int64, Stamps, Vector

ROUNDS = 2
"""Of looking for loops."""
MOST = 20
"""Segments that are looked for in the map of the first one."""
TOGETHER = 10
"""Keyframes that are looked for as one."""
TRIES, CHECKED = 8, 40
"""So many of them are tried, and so many keyframes must not contradict the place."""
AGREE = np.array([0.5, 0.5, 0.1])
"""How far two of them may place the segment apart (m, m, rad)."""
ROUGH = np.diag([0.1, 0.1, 0.05]) ** 2
"""Error of a place that was found in a map (m², m², rad²)."""
OFTEN = 0.9
"""Share of the scans that are placed, below which odometry may be in their way."""


class Followed(NamedTuple):
    """Poses as a stream tells them.

    >>> Followed._fields
    ('poses', 'took')
    """

    poses: Poses
    took: Vector
    """Time for each scan [s]."""


class Fused(NamedTuple):
    """The pose as it was known when wheels and gyro spoke.

    >>> Fused._fields
    ('t', 'pose', 'covariance', 'segment', 'late')
    """

    t: Stamps
    pose: Float64[np.ndarray, "n 3"]
    covariance: Float64[np.ndarray, "n 3 3"]
    segment: Int64[np.ndarray, " n"]
    """Of the map that the pose is told in, as it was when the scan came."""
    late: int
    """Words that came too late to be used."""


class Mapped(NamedTuple):
    """Poses of a recording.

    >>> Mapped._fields
    ('poses', 'keyframes', 'surfaces', 'loops', 'took', 'fused', 'lidar', 'findings')
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
    fused: Fused | None
    """At each word of the wheels, as a stream would tell it."""
    lidar: Lidar
    """Where it was found to look."""
    findings: tuple[str, ...]
    """What is odd about the scans, as sentences."""


def followed(scans: Scans, use_odometry: bool = True, look_ahead: bool = False) -> Followed:
    """The poses of a recording, scan by scan.

    As a stream tells them, without looking back; or with ``look_ahead``: what one scan leaves open
    is decided by those that follow, see `evertwin.features.look_ahead`.
    """
    n, beams = scans.ranges.shape
    moved = motion_at(scans) if use_odometry else np.zeros((n, 0))
    block = make_block(t=scans.t, u=moved, y=scans.ranges)
    matcher = ScanMatcher(scans.lidar, beams)
    if look_ahead:
        rows, took = read_on(matcher, block)
        return Followed(table(rows), took)
    state, outs, took = matcher.init(), [], np.zeros(n)
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
    return np.column_stack([wheels, _turned_at(scans, scans.t)])


def _turned_at(scans: Scans, t: Stamps) -> Vector:
    """The gyro's angle at some times [rad]; NaN without one."""
    if scans.gyro is None:
        return np.full(len(t), np.nan)
    known, rate = scans.gyro.t, scans.gyro.values[:, 0]
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(known) * 1e-9
    angle = np.concatenate([[0.0], np.cumsum(steps)])
    at, base = (t - known[0]) * 1e-9, (known - known[0]) * 1e-9
    return np.asarray(np.interp(at, base, angle, np.nan, np.nan))


def streamed(scans: Scans, poses: Poses) -> Fused | None:
    """The fused pose at each word of the wheels, from what had arrived by then.

    ``poses``: as they were followed. None without odometry of its own stamps.
    """
    if scans.wheels is None or scans.arrived is None:
        return None
    angle = _turned_at(scans, scans.wheels.t)
    heading = np.unwrap(scans.wheels.values[:, 2])
    wheels = [
        Turned(int(t), np.array([*pose[:2], turn]), float(a)) for t, pose, turn, a in
        zip(scans.wheels.t, scans.wheels.values, heading, angle, strict=True)
    ]  # fmt: skip
    scan = [(int(t), 1, k) for k, t in enumerate(scans.arrived)]
    events = sorted([(int(t), 0, k) for k, t in enumerate(scans.wheels.arrived)] + scan)
    live: Stream | None = None
    rows, segment, late = [], -1, 0
    for _, kind, k in events:
        if kind == 0:
            if live is not None:
                live = live.moved(wheels[k])
                rows.append((live.belief, segment))
        elif poses.fix[k] == Fix.MATCHED:
            if live is None or poses.segment[k] != segment:
                segment, late = int(poses.segment[k]), late + (0 if live is None else live.late)
                live = _begun(scans, poses, k, wheels)
            else:
                live = live.seen(int(scans.t[k]), Sighting(poses.sighted[k], poses.information[k]))
    if not rows:
        return None
    return Fused(
        np.array([one.t for one, _ in rows]), np.array([one.pose for one, _ in rows]),
        np.array([one.covariance[:3, :3] + COMMON for one, _ in rows]),
        np.array([one for _, one in rows]), late + (0 if live is None else live.late),
    )  # fmt: skip


def _begun(scans: Scans, poses: Poses, k: int, wheels: Sequence[Turned]) -> Stream | None:
    """From the first scan of a map on; None where the wheels say nothing of its time."""
    t = int(scans.t[k])
    after = bisect_left(wheels, t, key=lambda one: one.t)
    if after == len(wheels) or (after == 0 and wheels[0].t > t):
        return None
    at = wheels[max(after - 1, 0)].at(t, wheels[after])
    return Stream.begun(Belief.at_rest(t, poses.pose[k], np.zeros((3, 3))), at)


def mapped(scans: Scans, use_odometry: bool = True) -> Mapped:
    """The poses of a recording, its loops closed.

    Raises:
        DataError: no scan tells a pose.
        MissingExtra: GTSAM is not installed.
    """
    scans, (poses, took), said = _upright(without_body(scans), use_odometry)
    fused = streamed(scans, poses)
    poses = evened(poses, scans.odometry if use_odometry else None)
    if not ((poses.fix != Fix.LOST) & (poses.segment == 0)).any():
        raise DataError(
            f"{scans.name}: no scan tells a pose: does the lidar see anything? Ranges are taken "
            "in metres: in millimetres all of them would be too far"
        )
    poses, anchors = found_again(scans, poses)
    one = solved(scans, poses, anchors)
    if one.graph.failed:
        said.append("no map fits all that was seen: poses are as they were followed, loops open")
    return Mapped(
        _all(poses, one.keys, one.graph), one.graph.poses, one.surfaces, one.loops, took, fused,
        scans.lidar, (*scans.findings, *troubles(scans), *said),
    )  # fmt: skip


def _upright(scans: Scans, use_odometry: bool) -> tuple[Scans, Followed, list[str]]:
    """Followed; with the lidar turned to where scans and odometry together say that it looks."""
    found = followed(scans, use_odometry, look_ahead=True)
    wheels = scans.odometry
    if wheels is None or not use_odometry:
        return scans, found, []
    said: list[str] = []
    if mirrored(_by_scans(scans, found), wheels):
        one = scans.lidar
        scans = replace(scans, lidar=replace(one, start=-one.start, step=-one.step))
        said.append("the scans turn against the odometry: the beams are taken the other way round")
        found = followed(scans, use_odometry, look_ahead=True)
    sighted = _by_scans(scans, found)
    factors = scaled(found.poses.sighted, wheels), overturned(sighted, wheels, scans.lidar.step)
    said += filter(None, factors)
    angle = askew(sighted, wheels)
    if angle is None or abs(angle) < ASKEW:
        return scans, found, said
    x, y, turn = scans.lidar.mount
    turned = replace(scans, lidar=replace(scans.lidar, mount=(x, y, turn + angle)))
    side = "left" if angle > 0 else "right"
    said.append(
        f"by its scans and odometry the lidar looks {abs(np.degrees(angle)):.0f}° further to the "
        f"{side} than was said: taken to do so"
    )
    return turned, followed(turned, use_odometry, look_ahead=True), said


class Solved(NamedTuple):
    """The keyframes of one map.

    >>> Solved._fields
    ('keys', 'surfaces', 'graph', 'loops')
    """

    keys: Int64[np.ndarray, " k"]
    """Numbers of their scans."""
    surfaces: tuple[Surface, ...]
    graph: Optimised
    loops: int


def solved(scans: Scans, poses: Poses, anchors: Sequence[Edge] = ()) -> Solved:
    """The keyframes of segment 0, their loops closed; ``anchors``: between numbers of scans."""
    keys = np.flatnonzero(poses.keyframe & (poses.fix != Fix.LOST) & (poses.segment == 0))
    surfaces = tuple(surface_of(scans, int(k)) for k in keys)
    number = {int(k): n for n, k in enumerate(keys)}
    tied = [a._replace(start=number[a.start], end=number[a.end]) for a in anchors]
    begun = {edge.end for edge in tied}
    steps = [edge for edge in steps_between(poses, keys) if edge.end not in begun] + tied
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
    return Solved(keys, surfaces, graph, len(found))


def _by_scans(scans: Scans, found: Followed) -> Float64[np.ndarray, "n 3"]:
    """Poses by the scans, without odometry where that gets in their way."""
    share = float(np.mean(found.poses.fix == Fix.MATCHED))
    if share < OFTEN:
        alone = followed(scans, use_odometry=False, look_ahead=True).poses
        if np.mean(alone.fix == Fix.MATCHED) > share:
            return alone.sighted
    return found.poses.sighted


def found_again(scans: Scans, poses: Poses) -> tuple[Poses, list[Edge]]:
    """Later segments whose place the map so far tells join it; and what ties them to it.

    Looked for is what some keyframes of a segment saw, together: a single scan of a room may fit in
    several places. Where its first ones are not found, later ones may be. What the whole segment
    saw must not contradict the place. One that begins behind a bare corridor of unknown length is
    left: its corners are like those before it, and the map holds those alone.
    """
    anchors: list[Edge] = []
    number = int(poses.segment[-1])
    for k in range(1, min(number, MOST) + 1):
        mine = poses.segment == k
        keys = np.flatnonzero(poses.keyframe & (poses.fix != Fix.LOST) & mine)
        begin = int(np.argmax(mine))
        gone = np.arange(begin) > np.flatnonzero(poses.fix[:begin] != Fix.LOST)[-1:].sum()
        if not len(keys) or poses.share[:begin][gone].max(initial=0.0) >= FAMILIAR:
            continue
        first = solved(scans, poses, anchors)
        place = _place(scans, poses, keys, first)
        if place is None:
            continue
        near = int(np.argmin(np.hypot(*(first.graph.poses[:, :2] - place[:2]).T)))
        tie = between(first.graph.poses[near], place)
        anchors.append(Edge(int(first.keys[near]), int(keys[0]), tie, ROUGH))
        start = compose(poses.pose[first.keys[near]], tie)
        onward = between(np.broadcast_to(poses.pose[keys[0]], (mine.sum(), 3)), poses.pose[mine])
        pose, segment = poses.pose.copy(), np.where(mine, 0, poses.segment)
        pose[mine] = compose(np.broadcast_to(start, onward.shape), onward)
        poses = poses._replace(pose=pose, segment=segment)
    return poses, anchors


def _place(
    scans: Scans, poses: Poses, keys: Int64[np.ndarray, " k"], known: Solved
) -> Float64[np.ndarray, " 3"] | None:
    """Where the first of ``keys`` stands in a map; None where that cannot be told."""
    chart = of_keyframes(known.graph.poses, known.surfaces, scans.lidar.mount)
    steps = between(np.broadcast_to(poses.pose[keys[0]], (len(keys), 3)), poses.pose[keys])
    views = [View(surface_of(scans, int(k)), step) for k, step in zip(keys, steps, strict=True)]
    groups, places = range(0, len(keys), TOGETHER), list[np.ndarray]()
    for begin in groups[:: -(-len(groups) // TRIES)]:
        some, origin = views[begin : begin + TOGETHER], views[begin].pose
        home = between(origin, np.zeros(3))
        found = located([View(v.surface, between(origin, v.pose)) for v in some], chart).pose
        if found is None:
            continue
        place = compose(found, home)
        if through(views[:: max(len(views) // CHECKED, 1)], place, chart) > PASSED:
            continue
        alike = (np.abs(between(place, one)) < AGREE for one in places)
        if len(groups) == 1 or any(same.all() for same in alike):
            return place
        places.append(place)
    return None


def surface_of(scans: Scans, k: int) -> Surface:
    """The surface points of one scan, in the machine's frame."""
    return seen(scans.ranges[k], scans.lidar.angles(scans.ranges.shape[1]), scans.lidar.mount)


def _all(poses: Poses, keys: np.ndarray, graph: Optimised) -> Poses:
    """Every scan beside the keyframe before it; or the next, where it was lost in between."""
    scans, lost = np.arange(len(poses.t)), np.cumsum(poses.fix == Fix.LOST)
    at = np.maximum(np.searchsorted(keys, scans, side="right") - 1, 0)
    after = np.minimum(at + 1, len(keys) - 1)
    gone = (lost > lost[keys[at]]) & (lost == lost[keys[after]]) & (keys[after] > scans)
    at = np.where(gone, after, at)
    step = between(poses.pose[keys[at]], poses.pose)
    pose = compose(graph.poses[at], step)
    # what the graph tells of a keyframe is whole: its own scan's error is in the step to it
    beside = (keys[at] != scans)[:, None, None]
    covariance = graph.covariances[at] + beside * poses.covariance
    mine = (poses.segment == 0)[:, None]
    return poses._replace(
        pose=np.where(mine, pose, poses.pose),
        covariance=np.where(mine[..., None], covariance, poses.covariance),
    )
