"""The maps of a recording: the loops of each are closed, and those that are one are put together.

A robot that was lost, or came through a bare corridor whose length nothing tells, begins a segment,
a map of its own. Where parts of it are found in the map of another, it joins that one; the map is
then larger, and the others are looked for again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from evertwin.features.maps.loop_closure import DRIFT, TWIST, loops
from evertwin.features.maps.occupancy import of_keyframes
from evertwin.features.maps.open_ways import steps_between
from evertwin.features.maps.pose_graph import (
    Edge,
    Optimised,
    optimised,
    turned,
    variance_factor,
    weak,
)
from evertwin.features.maps.relocalisation import (
    Barriers,
    Charted,
    View,
    looked_for,
    stray,
    through,
)
from evertwin.features.scans.fusion import LIMIT
from evertwin.features.scans.local_map import Surface, seen
from evertwin.features.scans.poses import Fix, Poses
from evertwin.features.scans.scan_fit import COMMON
from evertwin.signals.planar import between, compose
from evertwin.sources.columns.scans import Scans
from evertwin.types import Float64, Int64

FIRST = 6
"""Keyframes that tell how far the first is off the map."""
ROUNDS = 2
"""Of looking for loops."""
TOGETHER = 10
"""Keyframes that are looked for as one."""
TRIES, MOST, CHECKED = 60, 150, 40
"""How often a segment is looked for in a map, and any; keyframes that must not contradict it."""
AGREE = np.array([0.5, 0.5, 0.1])
"""How far two of them may place the segment apart (m, m, rad)."""
SLACK = np.diag([0.5, 0.5, 0.1]) ** 2
"""Error of a map itself on the way from a segment to the next (m², m², rad²)."""
CONTRARY, PASSED = 2.0, 0.01
"""How much more often than itself a segment may contradict another, and what is nothing."""
ROUGH = np.diag([0.1, 0.1, 0.05]) ** 2
"""Error of a place that was found in a map (m², m², rad²)."""

Pose = Float64[np.ndarray, " 3"]


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


class Anchor(NamedTuple):
    """Where a segment stands in the map that it joined.

    >>> Anchor._fields
    ('begin', 'edge')
    """

    begin: int
    """Its first keyframe."""
    edge: Edge
    """Between the numbers of two scans."""


def keyframes(poses: Poses, number: int) -> Int64[np.ndarray, " k"]:
    """Numbers of the scans that a map is made of."""
    return np.flatnonzero(poses.keyframe & (poses.fix != Fix.LOST) & (poses.segment == number))


def solved(scans: Scans, poses: Poses, number: int = 0, anchors: Sequence[Anchor] = ()) -> Solved:
    """The keyframes of a segment and those that joined it, their loops closed."""
    keys = keyframes(poses, number)
    surfaces = tuple(surface_of(scans, int(k)) for k in keys)
    if not len(keys):
        return Solved(keys, surfaces, Optimised(np.zeros((0, 3)), np.zeros((0, 3, 3))), 0)
    at = {int(k): n for n, k in enumerate(keys)}
    begun = {at[one.begin] for one in anchors}
    tied = [a.edge._replace(start=at[a.edge.start], end=at[a.edge.end]) for a in anchors]
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
    origin = turned(origin_of(poses, keys), poses.pose[keys[0], 2])
    graph = optimised(graph.poses, [*steps, *found], origin)
    return Solved(keys, surfaces, graph, len(found))


def origin_of(poses: Poses, keys: Int64[np.ndarray, " k"]) -> Float64[np.ndarray, "3 3"]:
    """Covariance of a map's first scan about the map, along its axes: that of the scans after it.

    The first itself is matched to nothing, the next few to few.
    """
    told = poses.information[keys[1 : FIRST + 1]]
    return np.linalg.inv(told.mean(axis=0) + np.eye(3)) + COMMON if len(told) else COMMON.copy()


def joined(scans: Scans, poses: Poses) -> tuple[Poses, list[Solved]]:
    """Segments that one map tells have its number; and the map of each number."""
    maps, ways, left = list[Solved](), _ways(poses), iter(range(MOST))
    while len(maps) <= poses.segment.max():
        poses, one = _grown(_Looked(scans, ways, left), poses, len(maps))
        maps.append(one)
        poses = poses._replace(segment=np.unique(poses.segment, return_inverse=True)[1])
    return poses, maps


class _Looked(NamedTuple):
    """For segments in maps."""

    scans: Scans
    ways: Mapping[int, Edge]
    """To the first scan of a segment from the last one before; see `_ways`."""
    left: Iterator[int]
    """Places that are still looked for."""


def _ways(poses: Poses) -> dict[int, Edge]:
    """What is known of the way to the first scan of a segment, from the last one that is placed."""
    found, there = {}, np.flatnonzero(poses.fix != Fix.LOST)
    for last, begin in pairwise(there):
        if poses.segment[last] != poses.segment[begin] and poses.information[begin].any():
            spread = turned(np.linalg.inv(poses.information[begin]), poses.pose[begin, 2])
            step = between(poses.pose[last], poses.pose[begin])
            found[int(begin)] = Edge(int(last), int(begin), step, spread + SLACK)
    return found


def _grown(looked: _Looked, poses: Poses, number: int) -> tuple[Poses, Solved]:
    """A segment with all that its map tells the place of."""
    scans, origin = looked.scans, poses.segment
    one, anchors = solved(scans, poses, number), list[Anchor]()
    others = list(range(number + 1, int(origin.max()) + 1))
    waiting, ready = list(others) if len(one.keys) else [], None
    while waiting:
        k = waiting.pop(0)
        keys, ready = keyframes(poses, k), ready or _charted(scans, one)
        for anchor in _anchors(looked, poses, keys, (one, ready)):
            grown = _moved(poses, origin == k, number, anchor)
            more = solved(scans, grown, number, [*anchors, anchor])
            if not _contradicted(scans, more, np.isin(more.keys, keys)):
                poses, one, anchors = grown, more, [*anchors, anchor]
                others.remove(k)
                waiting, ready = list(others), None
                break
    return poses, one


def _charted(scans: Scans, one: Solved) -> Charted:
    return Charted.of(of_keyframes(one.graph.poses, one.surfaces, scans.lidar.mount))


def _moved(poses: Poses, mine: np.ndarray, number: int, anchor: Anchor) -> Poses:
    """A segment's poses as its anchor tells them."""
    start, end = anchor.edge.start, anchor.edge.end
    there = compose(poses.pose[start], anchor.edge.step)
    onward = between(np.broadcast_to(poses.pose[end], (mine.sum(), 3)), poses.pose[mine])
    pose = poses.pose.copy()
    pose[mine] = compose(np.broadcast_to(there, onward.shape), onward)
    return poses._replace(pose=pose, segment=np.where(mine, number, poses.segment))


def _anchors(
    looked: _Looked,
    poses: Poses,
    keys: Int64[np.ndarray, " k"],
    of: tuple[Solved, Charted],
) -> Iterator[Anchor]:
    """What may tie a segment of these keyframes to a map.

    Looked for is what some keyframes saw, together: a single scan of a room may fit in several
    places. Two such parts must place the segment alike, and where something is known of the way
    to it (through a corridor, say, whose ends are alike), not against that.
    """
    known, chart = of
    way = looked.ways.get(int(keys[0])) if len(keys) else None
    expected = None if way is None else _expected(poses, known, way)
    if not len(keys) or (way is not None and expected is None):
        return
    steps = between(np.broadcast_to(poses.pose[keys[0]], (len(keys), 3)), poses.pose[keys])
    saw = (surface_of(looked.scans, int(k)) for k in keys)
    views = [View(surface, step) for surface, step in zip(saw, steps, strict=True)]
    places, refused = list[_Place](), list[_Place]()
    for n in _order(len(keys), looked.left, places):
        some, origin = views[n : n + TOGETHER], views[n].pose
        found = looked_for([View(v.surface, between(origin, v.pose)) for v in some], chart).pose
        if found is None:
            continue
        here = _Place(n, found, origin)
        if way is not None and expected is not None:
            off = between(expected, here.at(np.zeros(3)))
            if off @ np.linalg.solve(way.covariance, off) > LIMIT:
                continue
        if any(here.alike(one) for one in refused):
            continue
        if len(keys) <= TOGETHER or any(here.alike(one) for one in places):
            near = int(np.argmin(np.hypot(*(known.graph.poses[:, :2] - found[:2]).T)))
            tie = between(known.graph.poses[near], found)
            yield Anchor(int(keys[0]), Edge(int(known.keys[near]), int(keys[n]), tie, ROUGH))
            refused.append(here)  # else nobody asked on
        places.append(here)


class _Place(NamedTuple):
    """Where a map has a part of a segment."""

    number: int
    """Of its first keyframe in the segment."""
    found: Pose
    origin: Pose
    """Of this keyframe in the segment's own frame."""

    def at(self, pose: Pose) -> Pose:
        """Where a pose of the segment is then."""
        return compose(self.found, between(self.origin, pose))

    def alike(self, other: _Place) -> bool:
        """Do both place the segment alike, as far as it is known how they lie to each other?"""
        far = float(np.hypot(*(other.origin - self.origin)[:2]))
        off = np.abs(between(other.at(self.origin), self.found))
        return bool(np.all(off < AGREE + far * np.array([DRIFT, DRIFT, TWIST])))


def _expected(poses: Poses, known: Solved, way: Edge) -> Pose | None:
    """Where a way leads in a map; None where it begins in another."""
    n = int(np.searchsorted(known.keys, way.start, side="right")) - 1
    if n < 0 or poses.segment[way.start] != poses.segment[known.keys[n]]:
        return None
    last = between(poses.pose[known.keys[n]], poses.pose[way.start])
    return compose(compose(known.graph.poses[n], last), way.step)


def _order(count: int, left: Iterator[int], places: Sequence[object]) -> Iterator[int]:
    """Of keyframes from which on some are looked for: all along, and beside one that was found."""
    apart = TOGETHER // 2
    waiting = list(range(0, count, -(-count // (apart * TRIES)) * apart))
    done = set[int]()
    while waiting and next(left, None) is not None:
        n, before = waiting.pop(0), len(places)
        done.add(n)
        yield n
        if len(places) > before:
            beside = (n + TOGETHER, n - TOGETHER, n + apart, n - apart)
            first = [m for m in beside if 0 <= m < count and m not in done]
            waiting = first + [m for m in waiting if m not in first]


def _contradicted(scans: Scans, one: Solved, mine: np.ndarray) -> bool:
    """Do keyframes that joined and the others contradict each other more than each itself?

    Where beams pass through walls, or end where another found nothing: people, glass and few scans
    do that in any map. Corridors that are alike do it far more often.
    """
    own, rest = np.flatnonzero(mine), np.flatnonzero(~mine)

    def against(some: np.ndarray, seen: np.ndarray) -> float:
        surfaces = [one.surfaces[n] for n in seen]
        chart = of_keyframes(one.graph.poses[seen], surfaces, scans.lidar.mount)
        some = some[:: max(len(some) // CHECKED, 1)]
        views, home = [View(one.surfaces[n], one.graph.poses[n]) for n in some], np.zeros(3)
        return through(views, home, Barriers.of(chart)) + stray(views, home, chart)

    usual = [against(part[1::2], part[::2]) for part in (own, rest) if len(part) > TOGETHER]
    each = sum(usual) / max(len(usual), 1)
    return against(own, rest) + against(rest, own) > 2 * max(CONTRARY * each, PASSED)


def surface_of(scans: Scans, k: int) -> Surface:
    """The surface points of one scan, in the machine's frame."""
    return seen(scans.ranges[k], scans.lidar.angles(scans.ranges.shape[1]), scans.lidar.mount)
