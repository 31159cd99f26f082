"""Scan to pose: each scan onto the local map of the scans before it.

    scan → surface points → expected pose → point to line ─ enough beside walls? ─ yes → pose
                              (odometry,                        │ no
                               or the last step again)          └→ every pose in a window → again

Every so often (`APART`, `TURNED`, or when little is recognised) a scan becomes a *keyframe*: its
points join the local map, and those of the oldest leave it. What the scans cannot tell (the way
along a bare corridor) stays as it was expected, and the covariance says so.

The pose is told in the frame of the first scan. Its covariance is about the place within the local
map; drift since the start is the pose graph's. Where neither the scan nor the odometry tells the
pose there is none (`Fix.LOST`); after `PATIENCE` such scans a new map is begun, a new *segment*,
whose place relative to the one before is unknown.

>>> from evertwin.fold import fold, make_block
>>> angles = np.radians(np.arange(-120, 121, 2.0))
>>> def room(x):                                        # 8 m × 6 m, seen from (x, 0)
...     with np.errstate(divide="ignore"):
...         walls = [(4 - x) / np.cos(angles), (-4 - x) / np.cos(angles),
...                  3 / np.sin(angles), -3 / np.sin(angles)]
...     return np.min([np.where(w > 0, w, np.inf) for w in walls], axis=0)
>>> scans = np.array([room(0.1 * i) for i in range(5)])
>>> block = make_block(t=np.arange(5) * 10**8, u=np.zeros((5, 0)), y=scans)
>>> matcher = ScanMatcher(Lidar(angles[0], np.radians(2.0), 30.0), beams=121)
>>> fold(matcher, [block])[1].rows.pose[:, 0].round(2).tolist()
[0.0, 0.1, 0.2, 0.3, 0.4]
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.features.correlation import Drawing, blocks, search
from evertwin.features.local_map import Known, LocalMap, Surface, empty, joined, known, seen
from evertwin.features.poses import Fix, Poses
from evertwin.features.registration import explained, register
from evertwin.fold import Block, Out
from evertwin.signals.planar import between, compose
from evertwin.sources.scans import Lidar
from evertwin.types import Float64, Vector

APART, TURNED = 0.3, 0.35
"""Way [m] and turn [rad] after which a scan becomes a keyframe."""
FAMILIAR = 0.7
"""Share of a scan's wall points that the map knows, below which it becomes one in any case."""
SURE, PLAUSIBLE = 0.95, 0.5
"""The same, above which the expected pose is not doubted: without odometry, and with it."""
LEAST, SEEN = 0.5, 0.3
"""The same, below which a scan tells no pose: without odometry, and with it."""
BETTER = 0.02
"""By how much more of the scan a pose from elsewhere must explain."""
FEW = 12
"""Points below which a scan tells no pose."""
AT_REST, SHARE = np.array([0.02, 0.02, 0.04]), np.array([0.05, 0.05, 0.2])
"""Error of odometry (m, m, rad): of any step, and as a share of its way and its turn."""
FREE = np.array([0.3, 0.3, 0.3])
"""How far a step may differ from the one before where there is no odometry (m, m, rad)."""
SLOW = 1.0
"""Time between scans from which on it may turn more in proportion [s], up to `LONG` times."""
LONG = 5.0
SUDDEN = 0.4
"""A step that turns by more is not expected again [rad]."""
WINDOW = 3.0
"""Half the window that is searched, in standard deviations of the expectation."""
WIDEST = 1.6
"""Its largest half width [m]."""
TURN = 0.03
"""Step between the headings that are tried [rad]."""
SOME = 80
"""Points of a scan that a search uses."""
DIRECTIONS = 8
"""Kinds of walls, by where they face."""
GRID = 512
"""Cells of the grid that it looks into, along each side."""
PATIENCE = 5
"""Scans without a pose after which a new map is begun."""
STANDING = 3
"""Times that a scan may come again, number by number, before the lidar is taken to be frozen."""
COMMON = np.diag([0.002, 0.002, 0.001]) ** 2
"""Error that all points of a map share (m², m², rad²)."""
ALIKE = 5.0
"""Neighbouring beams that err together: so many count as one."""
FAR = 1.0
"""Spread of a pose from which on it is none [m]."""
FIRM = 0.1
"""The same for one that is found again: much may look alike [m]."""

Pose = Float64[np.ndarray, " 3"]


class Following(NamedTuple):
    """State of `ScanMatcher`.

    >>> ScanMatcher(Lidar(0.0, 0.1, 30.0), 10).init().lost
    0
    """

    map: LocalMap
    pose: Pose
    step: Pose
    """From the scan before, in the robot's frame."""
    spread: Float64[np.ndarray, "3 3"]
    """Covariance of the pose."""
    odometry: Pose
    ranges: Vector
    """Of the last scan."""
    repeated: int
    """Times that they came again."""
    lost: int
    """Scans since there was a pose."""
    segment: int


class _Fit(NamedTuple):
    """A scan at a pose of the map."""

    pose: Pose
    share: float
    covariance: Float64[np.ndarray, "3 3"]


class Expected(NamedTuple):
    """Where a scan is looked for.

    >>> Expected(np.zeros(3), np.diag([0.04, 0.01, 0.01])).sigma[0]
    np.float64(0.2)
    """

    pose: Pose
    covariance: Float64[np.ndarray, "3 3"]

    @property
    def sigma(self) -> Vector:
        """Of its x, y and heading."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True)
class ScanMatcher:
    """Implements `evertwin.fold.Online`: outputs are ranges [m], inputs odometry (x, y, heading).

    >>> ScanMatcher(Lidar(0.0, 0.1, 30.0), 10).init().map.points.shape
    (20, 10, 4)
    """

    lidar: Lidar
    beams: int

    @cached_property
    def angles(self) -> Vector:
        """Of each beam [rad]."""
        return self.lidar.angles(self.beams)

    def init(self) -> Following:
        """Nothing seen yet; the first scan is the origin."""
        none = np.full(3, np.nan)
        return Following(
            empty(self.beams), np.zeros(3), np.zeros(3), np.zeros((3, 3)), none,
            np.full(self.beams, np.nan), 0, 0, 0,
        )  # fmt: skip

    def step(self, state: Following, block: Block) -> tuple[Following, Out]:
        """Follows the scans of a block."""
        rows = []
        view = known(state.map) if state.map.joined else None
        for i in range(len(block.t)):
            odometry = block.u[i] if block.u.shape[1] == 3 else np.full(3, np.nan)
            before = state.map.joined, state.segment
            state, row = self._follow(state, view, block.y[i], odometry, float(block.dt[i]))
            rows.append((block.t[i], *row, (state.map.joined, state.segment) != before))
            if rows[-1][-1]:
                view = known(state.map)
        t, pose, covariance, fix, share, segment, keyframe = zip(*rows, strict=True)
        return state, Out(
            Poses(
                np.array(t), np.array(pose), np.array(covariance), np.array(fix, np.uint8),
                np.array(share), np.array(keyframe, np.uint8), np.array(segment),
            )
        )  # fmt: skip

    def _follow(
        self, state: Following, view: Known | None, ranges: Vector, odometry: Pose, dt: float
    ) -> tuple[Following, tuple[object, ...]]:
        scan = seen(ranges, self.angles, self.lidar.mount)
        same = np.array_equal(ranges, state.ranges, equal_nan=True)
        state = state._replace(repeated=state.repeated + 1 if same else 0, ranges=ranges.copy())
        telling = len(scan) >= FEW and state.repeated < STANDING
        if view is None:
            return self._begun(state, scan, odometry, telling)
        expected = _expected(state, odometry, dt)
        sure, least = (SURE, LEAST) if _blind(odometry) else (PLAUSIBLE, SEEN)
        fit = _best(scan, view, expected, sure) if telling else None
        found_back = fit is not None and not (state.lost and _off(fit.covariance, FIRM))
        if fit is not None and found_back and fit.share >= least:
            return self._matched(state, scan, fit, odometry)
        spread = expected.covariance
        state = state._replace(pose=expected.pose, spread=spread, odometry=odometry.copy())
        share = 0.0 if fit is None else fit.share
        if not _blind(odometry) and not _off(spread, FAR) and telling:
            ring = joined(state.map, scan, expected.pose)
            state = state._replace(map=ring, lost=0)
            return state, (expected.pose, spread, Fix.PREDICTED, share, state.segment)
        state = state._replace(lost=state.lost + 1, step=np.zeros(3))
        if telling and state.lost > PATIENCE:
            state = state._replace(map=empty(self.beams), segment=state.segment + 1)
            return self._begun(state, scan, odometry, telling)
        none = np.full(3, np.nan), np.full((3, 3), np.nan)
        return state, (*none, Fix.LOST, share, state.segment)

    def _begun(
        self, state: Following, scan: Surface, odometry: Pose, telling: bool
    ) -> tuple[Following, tuple[object, ...]]:
        """The first scan of a map, which is where it says it is."""
        if not telling:
            none = np.full(3, np.nan), np.full((3, 3), np.nan)
            return state, (*none, Fix.LOST, 0.0, state.segment)
        pose, spread = state.pose, COMMON.copy()
        state = state._replace(
            map=joined(state.map, scan, pose), step=np.zeros(3), spread=spread,
            odometry=odometry.copy(), lost=0,
        )  # fmt: skip
        return state, (pose.copy(), spread.copy(), Fix.MATCHED, 1.0, state.segment)

    def _matched(
        self, state: Following, scan: Surface, fit: _Fit, odometry: Pose
    ) -> tuple[Following, tuple[object, ...]]:
        d = between(state.map.newest, fit.pose)
        moved = math.hypot(d[0], d[1]) > APART or abs(d[2]) > TURNED
        ring = state.map
        if moved or fit.share < FAMILIAR:
            ring = joined(ring, scan, fit.pose)
        state = state._replace(
            map=ring, pose=fit.pose, step=between(state.pose, fit.pose), spread=fit.covariance,
            odometry=odometry.copy(), lost=0,
        )  # fmt: skip
        if _off(fit.covariance, FAR):  # walls alike all along the way
            none = np.full(3, np.nan), np.full((3, 3), np.nan)
            return state, (*none, Fix.LOST, fit.share, state.segment)
        row = fit.pose.copy(), fit.covariance.copy(), Fix.MATCHED, fit.share, state.segment
        return state, row


def _off(covariance: np.ndarray, limit: float) -> bool:
    """Is a place more uncertain than ``limit`` [m]?"""
    return bool(covariance[0, 0] + covariance[1, 1] > limit * limit)


def _blind(odometry: Pose) -> bool:
    return not bool(np.all(np.isfinite(odometry)))


def _expected(state: Following, odometry: Pose, dt: float) -> Expected:
    """By odometry, else by the last step again: robots go on more often than they start or stop."""
    if not _blind(odometry) and not _blind(state.odometry):
        step = between(state.odometry, odometry)
        way, turn = math.hypot(step[0], step[1]), abs(step[2])
        sigma = AT_REST + SHARE * np.array([way, way, turn])
    else:
        step = state.step if abs(state.step[2]) < SUDDEN else np.zeros(3)
        sigma = FREE * np.array([1.0, 1.0, min(max(dt / SLOW, 1.0), LONG)])
    sigma = sigma * (1 + state.lost)
    return Expected(compose(state.pose, step), state.spread + np.diag(sigma * sigma))


def _best(scan: Surface, view: Known, expected: Expected, sure: float) -> _Fit:
    """The scan where it is expected or, if that explains too little, where it fits best."""
    fit = fitted(scan, view, expected, expected.pose)
    if fit.share >= sure:
        return fit
    some = balanced(scan)
    found = found_by_search(some, view.points, expected.pose, (
        min(WINDOW * expected.sigma[0], WIDEST), min(WINDOW * expected.sigma[2], math.pi)
    ))  # fmt: skip
    other = fitted(scan, view, expected, found)
    here, there = (explained(some, len(some), *view, one.pose) for one in (fit, other))
    return other if there > here + BETTER else fit


def balanced(scan: Surface) -> Surface:
    """Some points of a scan, from walls of every direction alike: else the long ones decide alone.

    Rusinkiewicz and Levoy, 3DIM 2001.
    """
    facing = np.floor(np.arctan2(scan[:, 3], scan[:, 2]) / (2 * np.pi) * DIRECTIONS) % DIRECTIONS
    facing[(scan[:, 2] == 0) & (scan[:, 3] == 0)] = DIRECTIONS
    kinds = [np.flatnonzero(facing == k) for k in range(DIRECTIONS + 1)]
    kinds = sorted((kind for kind in kinds if len(kind)), key=len)
    chosen, left = [], SOME
    for k, kind in enumerate(kinds):
        take = min(len(kind), left // (len(kinds) - k))
        chosen.append(kind[np.linspace(0, len(kind) - 1, take).astype(np.int64)])
        left -= take
    return np.ascontiguousarray(scan[np.sort(np.concatenate(chosen))])


def found_by_search(
    scan: Surface, points: Surface, middle: Pose, window: tuple[float, float]
) -> Pose:
    """The best pose within ``window`` (m, rad) to either side of ``middle``; see `search`."""
    drawing, side = Drawing.of(points, middle[:2], GRID), blocks(window[0])
    everywhere = np.ones((side, side), np.uint8)
    return search(scan, drawing, np.array([*window, TURN]), everywhere, middle)[0]


def fitted(scan: Surface, view: Known, expected: Expected, start: Pose) -> _Fit:
    """The scan matched from ``start``, with what is expected of its pose."""
    pose, information = start.copy(), np.zeros((3, 3))
    weight = ALIKE * np.linalg.inv(expected.covariance)
    share, _ = register(
        scan, len(scan), view.points, view.heads, view.order, expected.pose, weight, pose,
        information,
    )  # fmt: skip
    covariance = ALIKE * np.linalg.inv(information + weight) + COMMON
    return _Fit(pose, share, covariance)
