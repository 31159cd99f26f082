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

from evertwin.features.contradiction import contradicted
from evertwin.features.fusion import Belief, Sighting, Step, measured, predicted
from evertwin.features.local_map import Known, LocalMap, Surface, empty, joined, known, seen
from evertwin.features.poses import Fix, Poses
from evertwin.features.scan_fit import COMMON, Expected, Fit, best
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
PATIENCE = 5
"""Scans without a pose after which a new map is begun."""
STANDING = 3
"""Times that a scan may come again, number by number, before the lidar is taken to be frozen."""
MOVED = 0.02
"""By how much the wheels go on while a lidar that repeats a scan is frozen [m, rad]."""
BLOCKED, MOST_NEAR = 0.35, 0.8
"""A lidar most of whose beams end nearer than this is blocked [m]; and how many."""
THROUGH = 0.2
"""Share of the beams that pass through known walls from which on the robot is elsewhere."""
AGAIN = 0.05
"""The same for a robot that was lost: rooms have places that are alike."""
FOUND = 0.6
"""Share of a scan from which on a lost robot is found again."""
FAR = 1.0
"""Spread of a pose from which on it is none [m]."""
FIRM = 0.1
"""The same for one that is found again: much may look alike [m]."""

Pose = Float64[np.ndarray, " 3"]
Motion = Float64[np.ndarray, " 4"]
"""Wheels' pose and gyro's angle; NaN where they are not known."""


class Following(NamedTuple):
    """State of `ScanMatcher`.

    >>> ScanMatcher(Lidar(0.0, 0.1, 30.0), 10).init().lost
    0
    """

    map: LocalMap
    belief: Belief
    """Pose, and what is known of wheels and gyro."""
    step: Pose
    """From the scan before, in the robot's frame."""
    moved: Motion
    """Wheels' pose and gyro's angle at the last scan."""
    ranges: Vector
    """Of the last scan."""
    repeated: int
    """Times that they came again."""
    lost: int
    """Scans since there was a pose."""
    segment: int


class _Row(NamedTuple):
    """What a scan tells; see `Poses`."""

    pose: Pose = np.full(3, np.nan)
    covariance: Float64[np.ndarray, "3 3"] = np.full((3, 3), np.nan)
    fix: Fix = Fix.LOST
    share: float = 0.0
    segment: int = 0
    sighting: Sighting = Sighting(np.full(3, np.nan), np.zeros((3, 3)))
    slip: bool = False
    scale: float = math.nan


@dataclass(frozen=True)
class ScanMatcher:
    """Implements `evertwin.fold.Online`: outputs are ranges [m]; inputs are none, or odometry
    (x, y, heading), or this and the gyro's angle; NaN where there is none.

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
        belief = Belief.at_rest(0, np.zeros(3), np.zeros((3, 3)))
        return Following(
            empty(self.beams), belief, np.zeros(3), np.full(4, np.nan),
            np.full(self.beams, np.nan), 0, 0, 0,
        )  # fmt: skip

    def step(self, state: Following, block: Block) -> tuple[Following, Out]:
        """Follows the scans of a block."""
        rows = []
        view = known(state.map) if state.map.joined else None
        for i in range(len(block.t)):
            moved = np.full(4, np.nan)
            moved[: block.u.shape[1]] = block.u[i]
            before = state.map.joined, state.segment
            state, row = self._follow(state, view, block.y[i], moved, float(block.dt[i]))
            rows.append((block.t[i], row, (state.map.joined, state.segment) != before))
            if rows[-1][-1]:
                view = known(state.map)
        t, told, keyframe = zip(*rows, strict=True)
        pose, covariance, fix, share, segment, sighting, slip, scale = zip(*told, strict=True)
        return state, Out(
            Poses(
                np.array(t), np.array(pose), np.array(covariance), np.array(fix, np.uint8),
                np.array(share), np.array(keyframe, np.uint8), np.array(segment),
                np.array([one.pose for one in sighting]),
                np.array([one.information for one in sighting]), np.array(slip, np.uint8),
                np.array(scale),
            )
        )  # fmt: skip

    def _follow(
        self, state: Following, view: Known | None, ranges: Vector, moved: Motion, dt: float
    ) -> tuple[Following, _Row]:
        scan = seen(ranges, self.angles, self.lidar.mount)
        same = np.array_equal(ranges, state.ranges, equal_nan=True)
        state = state._replace(repeated=state.repeated + 1 if same else 0, ranges=ranges.copy())
        before, state = state.moved, state._replace(moved=moved.copy())
        went = moved[:3] - before[:3]  # NaN without wheels: then nothing says that it moved
        frozen = state.repeated >= STANDING or (same and bool(np.abs(went).max() > MOVED))
        near = float(np.mean(ranges[np.isfinite(ranges)] < BLOCKED)) if len(scan) else 1.0
        telling = len(scan) >= FEW and not frozen and near < MOST_NEAR
        if view is None:
            return self._begun(state, scan, telling)
        blind = _blind(moved) or _blind(before)
        ahead, expected = _expected(state, moved - before, blind, dt)
        sure, least = (SURE, LEAST) if blind else (PLAUSIBLE, SEEN)
        fit = best(scan, view, expected, sure) if telling else None
        if fit is not None and self._elsewhere(fit, ranges, view, bool(state.lost)):
            fit, blind = None, True
        if fit is not None and fit.share >= (FOUND if state.lost else least):
            way = 0.0 if blind else float(np.hypot(*(moved - before)[:2]))
            return self._matched(state, scan, fit, ahead, way)
        state = state._replace(belief=ahead)
        share, spread = 0.0 if fit is None else fit.share, ahead.covariance[:3, :3]
        if not (blind or state.lost or _off(spread, FAR)):
            d = between(state.map.newest, ahead.pose)
            new = math.hypot(d[0], d[1]) > 2 * APART or abs(d[2]) > 2 * TURNED
            ring = joined(state.map, scan, ahead.pose) if telling and new else state.map
            state = state._replace(map=ring, lost=0)
            return state, _Row(ahead.pose, spread, Fix.PREDICTED, share, state.segment)
        state = state._replace(lost=state.lost + 1, step=np.zeros(3))
        if telling and state.lost > PATIENCE:
            state = state._replace(map=empty(self.beams), segment=state.segment + 1)
            return self._begun(state, scan, telling)
        return state, _Row(share=share, segment=state.segment)

    def _elsewhere(self, fit: Fit, ranges: Vector, view: Known, lost: bool) -> bool:
        """Is the robot elsewhere than where its scan fits best?"""
        if fit.share >= FAMILIAR and not lost:
            return False
        lidar = compose(fit.pose, np.array(self.lidar.mount))
        through = contradicted(ranges, self.angles, lidar, view.points)
        return through > (AGAIN if lost else THROUGH) or (lost and _off(fit.covariance, FIRM))

    def _begun(self, state: Following, scan: Surface, telling: bool) -> tuple[Following, _Row]:
        """The first scan of a map, which is where it says it is."""
        if not telling:
            return state, _Row(segment=state.segment)
        pose = state.belief.pose
        state = state._replace(
            map=joined(state.map, scan, pose), step=np.zeros(3), lost=0,
            belief=state.belief.moved(state.belief.t, pose, np.zeros((3, 3))),
        )  # fmt: skip
        firm = Sighting(pose, np.linalg.inv(COMMON))
        return state, _Row(pose.copy(), COMMON.copy(), Fix.MATCHED, 1.0, state.segment, firm)

    def _matched(
        self, state: Following, scan: Surface, fit: Fit, ahead: Belief, way: float
    ) -> tuple[Following, _Row]:
        found = measured(ahead, fit.sighting, way)
        pose, spread = found.belief.pose, found.belief.covariance[:3, :3] + COMMON
        d = between(state.map.newest, pose)
        moved = math.hypot(d[0], d[1]) > APART or abs(d[2]) > TURNED
        ring = state.map
        if moved or fit.share < FAMILIAR:
            ring = joined(ring, scan, pose)
        step = between(state.belief.pose, pose)
        state = state._replace(map=ring, belief=found.belief, step=step, lost=0)
        row = _Row(
            pose.copy(), spread, Fix.MATCHED, fit.share, state.segment, fit.sighting, found.slip,
            found.belief.scale,
        )  # fmt: skip
        if _off(spread, FAR):  # walls alike all along the way
            return state, _Row(share=fit.share, segment=state.segment)
        return state, row


def _off(covariance: np.ndarray, limit: float) -> bool:
    """Is a place more uncertain than ``limit`` [m]?"""
    return bool(covariance[0, 0] + covariance[1, 1] > limit * limit)


def _blind(moved: Motion) -> bool:
    """Do the wheels say nothing?"""
    return not bool(np.all(np.isfinite(moved[:3])))


def _expected(state: Following, went: Motion, blind: bool, dt: float) -> tuple[Belief, Expected]:
    """By wheels and gyro, else by the last step again: robots go on more often than they start or
    stop."""
    lasts = round(1e9 * dt)
    if blind:
        step = state.step.copy() if abs(state.step[2]) < SUDDEN else np.zeros(3)
        sigma = FREE * np.array([1.0, 1.0, min(max(dt / SLOW, 1.0), LONG)])
        if math.isfinite(went[3]):
            step[2], sigma[2] = went[3] - state.belief.bias * dt, AT_REST[2]
        at = state.belief
        spread = at.covariance[:3, :3] + np.diag((sigma * (1 + state.lost)) ** 2)
        ahead = at.moved(at.t + lasts, compose(at.pose, step), spread)
        return ahead, Expected(ahead.pose, spread)
    wheels = between(state.moved[:3] - went[:3], state.moved[:3])
    ahead = predicted(state.belief, Step(lasts, wheels, float(went[3])))
    way, turn = math.hypot(wheels[0], wheels[1]), abs(wheels[2])
    sigma = (AT_REST + SHARE * np.array([way, way, turn])) * (1 + state.lost)
    return ahead, Expected(ahead.pose, ahead.covariance[:3, :3] + np.diag(sigma * sigma))
