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
from evertwin.features.maps.look_ahead import read_on
from evertwin.features.maps.open_ways import evened
from evertwin.features.maps.pose_graph import at_origin
from evertwin.features.maps.segments import Solved, joined, keyframes, origin_of
from evertwin.features.maps.troubles import (
    ASKEW,
    askew,
    lever,
    mirrored,
    overturned,
    scaled,
    straightened,
    troubles,
    without_body,
    without_cover,
)
from evertwin.features.scans.fusion import Belief, Sighting
from evertwin.features.scans.local_map import Surface
from evertwin.features.scans.motion import motion_at, silence, turned_at
from evertwin.features.scans.poses import Fix, Poses, table
from evertwin.features.scans.scan_fit import COMMON
from evertwin.features.scans.scan_matcher import ScanMatcher
from evertwin.features.scans.stream import Stream, Turned
from evertwin.features.scans.trust import doubtful, trusted, without_repeats
from evertwin.fold import join, make_block, take
from evertwin.signals.planar import between, compose
from evertwin.sources.columns.scans import Lidar, Scans
from evertwin.types import Float64, Int64, Stamps, Vector

OVERLAP = 12
"""Keyframes that see the same walls."""
FARTHEST = 200.0
"""Middle of all ranges above which they are not in metres."""
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
    is decided by those that follow, see `evertwin.features.maps.look_ahead`.
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


def streamed(scans: Scans, poses: Poses) -> Fused | None:
    """The fused pose at each word of the wheels, from what had arrived by then.

    ``poses``: as they were followed. None without odometry of its own stamps.
    """
    if scans.wheels is None or scans.arrived is None:
        return None
    angle = turned_at(scans, scans.wheels.t)
    heading = np.unwrap(scans.wheels.values[:, 2])
    wheels = [
        Turned(int(t), np.array([*pose[:2], turn]), float(a)) for t, pose, turn, a in
        zip(scans.wheels.t, scans.wheels.values, heading, angle, strict=True)
    ]  # fmt: skip
    scan = [(int(t), 1, k) for k, t in enumerate(scans.arrived)]
    events = sorted([(int(t), 0, k) for k, t in enumerate(scans.wheels.arrived)] + scan)
    live: Stream | None = None
    rows, segment, late, silent = [], -1, 0, silence(scans.wheels.t)
    for _, kind, k in events:
        if kind == 0:
            if live is not None and wheels[k].t - live.now.wheels.t > silent:  # begins anew
                late += live.late
                live = None
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
    t, of = np.array([one.t for one, _ in rows]), np.array([one for _, one in rows])
    pose = np.array([one.pose for one, _ in rows])
    covariance = np.array([one.covariance[:3, :3] for one, _ in rows]) + drift(
        scans, poses, t, pose, of
    )
    return Fused(t, pose, covariance, of, late + (0 if live is None else live.late))


def drift(
    scans: Scans, poses: Poses, t: Stamps, pose: Float64[np.ndarray, "n 3"], segment: np.ndarray
) -> Float64[np.ndarray, "n 3 3"]:
    """Covariance of the local map about the first scan of its segment, where the machine is.

    A scan that joins the map errs by what its fit does, and the map by the mean of those that see
    the same walls: where they are n, it moves by (2 / (n + 1))² of the variance of one.
    """
    out = np.tile(COMMON, (len(t), 1, 1))
    for number in np.unique(segment):
        mine, keys = segment == number, keyframes(poses, int(number))
        if len(keys) < 2:
            continue
        own = np.linalg.inv(poses.information[keys[1:]] + np.eye(3))
        own = np.concatenate([[origin_of(poses, keys) - COMMON], own])
        share = np.full(len(keys), (2 / (OVERLAP + 1)) ** 2)
        share[0] = 1.0
        turns = np.array([at_origin(one, False) for one in poses.pose[keys]])
        parts = np.cumsum(share[:, None, None] * (turns @ own @ turns.transpose(0, 2, 1)), axis=0)
        k = np.maximum(np.searchsorted(scans.t[keys], t[mine], side="right") - 1, 0)
        back = np.array([np.linalg.inv(at_origin(one, False)) for one in pose[mine]])
        out[mine] += back @ parts[k] @ back.transpose(0, 2, 1)
    return out


def _begun(scans: Scans, poses: Poses, k: int, wheels: Sequence[Turned]) -> Stream | None:
    """From the first scan of a map on; None where the wheels say nothing of its time."""
    t = int(scans.t[k])
    after = bisect_left(wheels, t, key=lambda one: one.t)
    if after == len(wheels) or (after == 0 and wheels[0].t > t):
        return None
    before = wheels[max(after - 1, 0)]
    assert scans.wheels is not None
    if wheels[after].t - before.t > silence(scans.wheels.t):
        return None
    at = before.at(t, wheels[after])
    return Stream.begun(Belief.at_rest(t, poses.pose[k], np.zeros((3, 3))), at)


def mapped(scans: Scans, use_odometry: bool = True) -> Mapped:
    """The poses of a recording, its loops closed.

    Raises:
        DataError: no scan tells a pose, or ranges are not in metres.
        MissingExtra: GTSAM is not installed.
    """
    seen = scans.ranges[np.isfinite(scans.ranges)]
    if len(seen) and np.median(seen) > FARTHEST:
        raise DataError(
            f"{scans.name}: half of the ranges are over {FARTHEST:.0f}: expected metres; are they "
            "in millimetres or centimetres?"
        )
    odd, scans = troubles(scans), straightened(scans)
    scans, (poses, took), said = _upright(without_cover(without_body(scans)), use_odometry)
    fused = streamed(scans, poses)
    poses = evened(poses, scans.odometry if use_odometry else None)
    if not ((poses.fix != Fix.LOST) & (poses.segment == 0)).any():
        raise DataError(
            f"{scans.name}: no scan tells a pose: does the lidar see anything? Ranges are taken "
            "in metres: in millimetres all of them would be too far"
        )
    poses, maps = joined(scans, poses)
    if any(one.graph.failed for one in maps):
        said.append("no map fits all that was seen: poses are as they were followed, loops open")
    for number, one in enumerate(maps):
        poses = _all(poses, number, one)
    first = maps[0]
    return Mapped(
        poses, first.graph.poses, first.surfaces, first.loops, took, fused, scans.lidar,
        (*scans.findings, *odd, *said),
    )  # fmt: skip


def _upright(scans: Scans, use_odometry: bool) -> tuple[Scans, Followed, list[str]]:
    """Followed; with the lidar turned to where scans and odometry together say that it looks."""
    said: list[str] = []
    scans = without_repeats(scans) if use_odometry else scans
    if use_odometry and doubtful(scans):
        alone = followed(scans, use_odometry=False, look_ahead=True)
        scans, said = trusted(scans, alone.poses)
    found = followed(scans, use_odometry, look_ahead=True)
    if use_odometry and not said:
        scans, said = trusted(scans, found.poses)
        found = followed(scans, use_odometry, look_ahead=True) if said else found
    wheels = scans.odometry
    if wheels is None or not use_odometry:
        return scans, found, said
    if mirrored(_by_scans(scans, found), wheels):
        one = scans.lidar
        if scans.handed:
            wheels = wheels * [1.0, -1.0, -1.0]
            scans, what = replace(scans, odometry=wheels), "its turns"
        else:
            scans = replace(scans, lidar=replace(one, start=-one.start, step=-one.step))
            what = "the beams"
        said.append(f"the scans turn against the odometry: {what} are taken the other way round")
        found = followed(scans, use_odometry, look_ahead=True)
    sighted = _by_scans(scans, found)
    said += filter(None, (scaled(sighted, wheels), overturned(sighted, wheels, scans.lidar.step)))
    turned, how = _placed(scans, sighted)
    if turned is scans:
        return scans, found, said
    return turned, followed(turned, use_odometry, look_ahead=True), [*said, *how]


def _placed(scans: Scans, sighted: Float64[np.ndarray, "n 3"]) -> tuple[Scans, list[str]]:
    """With the lidar where scans and odometry together say that it is, and what is said of it."""
    wheels, said = scans.odometry, list[str]()
    assert wheels is not None
    x, y, turn = scans.lidar.mount
    angle = askew(sighted, wheels)
    if angle is not None and abs(angle) >= ASKEW:
        turn += angle
        side = "left" if angle > 0 else "right"
        said.append(
            f"by its scans and odometry the lidar looks {abs(np.degrees(angle)):.0f}° further to "
            f"the {side} than was said: taken to do so"
        )
    aside = lever(sighted, wheels) if not said else None
    if aside is not None:
        said.append(
            f"by its scans and odometry the lidar is {aside[0]:.2f} m ahead and {aside[1]:.2f} m to"
            " the left of where was said: taken to be there"
        )
        if scans.handed:  # poses are the lidar's
            there = np.broadcast_to(np.array([*aside, 0.0]), wheels.shape)
            return replace(scans, odometry=compose(wheels, there)), said
        x, y = x + float(aside[0]), y + float(aside[1])
    if not said:
        return scans, said
    return replace(scans, lidar=replace(scans.lidar, mount=(x, y, turn))), said


def _by_scans(scans: Scans, found: Followed) -> Float64[np.ndarray, "n 3"]:
    """Poses by the scans, without odometry where that gets in their way."""
    share = float(np.mean((found.poses.fix == Fix.MATCHED) & (found.poses.slip == 0)))
    if share < OFTEN:
        alone = followed(scans, use_odometry=False, look_ahead=True).poses
        if np.mean(alone.fix == Fix.MATCHED) > share:
            return alone.sighted
    return found.poses.sighted


def _all(poses: Poses, number: int, one: Solved) -> Poses:
    """Every scan of a map beside the keyframe before it; or the next, where it was lost between."""
    keys, graph = one.keys, one.graph
    if not len(keys):
        return poses
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
    mine = (poses.segment == number)[:, None]
    return poses._replace(
        pose=np.where(mine, pose, poses.pose),
        covariance=np.where(mine[..., None], covariance, poses.covariance),
    )
