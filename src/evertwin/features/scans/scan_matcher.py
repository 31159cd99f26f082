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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.features.scans import scan_fit
from evertwin.features.scans.came import Came, Motion
from evertwin.features.scans.contradiction import contradicted
from evertwin.features.scans.fusion import Belief, Sighting, Step, measured, predicted
from evertwin.features.scans.habits import Habits
from evertwin.features.scans.local_map import (
    Known,
    LocalMap,
    Surface,
    copied,
    empty,
    joined,
    known,
    seen,
)
from evertwin.features.scans.poses import Fix, Row, table
from evertwin.features.scans.registration import NARROW, UNSEEN
from evertwin.features.scans.scan_fit import Expected, Fit
from evertwin.features.scans.scan_pace import ScanPace
from evertwin.fold import Block, Out
from evertwin.signals.planar import between, compose
from evertwin.sources.columns.scans import Lidar
from evertwin.types import Float64, Vector

APART, TURNED = 0.3, 0.35
"""Way [m] and turn [rad] after which a scan becomes a keyframe."""
FAMILIAR = 0.7
"""Share of a scan's wall points that the map knows, below which it becomes one in any case."""
SURE, PLAUSIBLE = 0.95, 0.5
"""The same, above which the expected pose is not doubted: without odometry, and with it."""
LEAST, SEEN = 0.5, 0.3
"""The same, below which a scan tells no pose: without odometry, and with it."""
BRIEFLY = 2
"""Scans that a robot may be lost, and still be where it was expected."""
NONE = 0.2
"""The same, below which it tells none even where most of it lies beyond the map."""
FEW = 12
"""Points below which a scan tells no pose."""
AT_REST, SHARE = np.array([0.02, 0.02, 0.04]), np.array([0.05, 0.05, 0.2])
"""Error of odometry (m, m, rad): of any step, and as a share of its way and its turn."""
FARTHEST = 4.0
"""How far a robot may have gone in a hole of its scans: beyond, much is alike [m]."""
FREE = 0.3
"""How far a turn may differ from the one before where there is no odometry [rad]."""
FARTHER = 1.2
"""How much longer than the longest one of late a step may be."""
ABOUT = 1.6
"""Half the window of its turn, at least: robots turn on the spot; beyond it is doubted [rad]."""
SLOW, LONG = 1.0, 5.0
"""Time between scans from which on it may turn more in proportion [s], and up to how often."""
PATIENCE = 5
"""Scans without a pose after which a new map is begun."""
STANDING = 3
"""Times that a scan may come again, number by number, before the lidar is taken to be frozen."""
MOVED = 0.02
"""By how much the wheels go on while a lidar that repeats a scan is frozen [m, rad]."""
BLOCKED, MOST_NEAR = 0.35, 0.8
"""A lidar most of whose beams end nearer than this is blocked [m]; and how many."""
THROUGH = 0.25
"""Share of the beams that pass through known walls from which on the robot is elsewhere."""
AGAIN = 0.05
"""The same for a robot that was lost: rooms have places that are alike."""
FOUND = 0.6
"""Share of a scan from which on a lost robot is found again."""
CONTENT, AGAINST = 0.9, 5.0
"""Share of a scan below which wheels that lead there may be wrong; and logarithm of how much
likelier the scan must then be elsewhere."""
FAR, OPEN = 1.0, 0.5
"""Spread of a pose from which on it is none: by the wheels, and by habit alone [m]."""
FIRM = 0.1
"""The same for one that is found again: much may look alike [m]."""
OFTEN = 0.2
"""How much one keyframe tells of how many scans there are from one to the next."""

Pose = Float64[np.ndarray, " 3"]
Matching = Callable[[Surface, Known, Expected, float], list[Fit]]
UNKNOWN = np.zeros((3, 3))


class Following(NamedTuple):
    """State of `ScanMatcher`.

    >>> ScanMatcher(Lidar(0.0, 0.1, 30.0), 10).init().lost
    0
    """

    map: LocalMap
    belief: Belief
    """Pose, and what is known of wheels and gyro."""
    habits: Habits
    """How it has moved so far."""
    moved: Motion
    """Wheels' pose and gyro's angle at the last scan."""
    ranges: Vector
    """Of the last scan."""
    repeated: int
    """Times that they came again."""
    lost: int
    """Scans since there was a pose."""
    open: int
    """Scans that were matched since, but told no place along their walls."""
    segment: int
    carried: bool = False
    """Did its beams pass through walls of the map, while its wheels said that it was there?"""
    since: int = 0
    """Scans since the newest keyframe."""
    often: float = 1.0
    """Scans from keyframe to keyframe, of late."""
    pace: ScanPace = ScanPace()
    denied: bool = False
    """Did its last scan tell a place, but none that its wheels led to?"""


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
            empty(self.beams), belief, Habits.none(), np.full(4, np.nan),
            np.full(self.beams, np.nan), 0, 0, 0, 0,
        )  # fmt: skip

    def step(self, state: Following, block: Block) -> tuple[Following, Out]:
        """Follows the scans of a block."""
        rows = []
        view = known(state.map) if state.map.joined else None
        for i in range(len(block.t)):
            before = state.map.joined, state.segment
            [(state, row, _)] = self.read(state, view, Came.of(block, i), _decided)
            rows.append((int(block.t[i]), row, (state.map.joined, state.segment) != before))
            if rows[-1][-1]:
                view = known(state.map)
        return state, Out(table(rows))

    def read(
        self, state: Following, view: Known | None, came: Came, fit: Matching
    ) -> Iterator[tuple[Following, Row, float]]:
        """What one scan more makes of a state: for each place that it may have been taken from.

        Args:
            state: before it; consumed by the last of what comes.
            view: its map.
            came: the scan.
            fit: tells the places.

        Yields:
            a state, what it tells, and the logarithm of how likely it is, up to a constant.
        """
        ranges, moved, dt = came
        scan = seen(ranges, self.angles, self.lidar.mount)
        same = np.array_equal(ranges, state.ranges, equal_nan=True)
        state = state._replace(repeated=state.repeated + 1 if same else 0, ranges=ranges.copy())
        before, state = state.moved, state._replace(moved=moved.copy())
        went = moved[:3] - before[:3]  # NaN without wheels: then nothing says that it moved
        frozen = state.repeated >= STANDING or (same and bool(np.abs(went).max() > MOVED))
        shut = float(np.mean(ranges[np.isfinite(ranges)] < BLOCKED)) if len(scan) else 1.0
        telling = len(scan) >= FEW and not frozen and shut < MOST_NEAR
        if view is None:
            yield *self._begun(state, scan, telling), 0.0
            return
        blind = _blind(moved) or _blind(before)
        pace = state.pace.after(dt, steps=state.habits.reach[0] if blind else math.inf)
        state, gone = state._replace(since=state.since + 1, pace=pace), state.lost + pace.missed
        ahead, expected = _expected(state, moved - before, blind, dt, gone)
        expected = expected._replace(shared=max(state.often, state.since) - 1)
        sure, least = (SURE, LEAST) if blind else (PLAUSIBLE, SEEN)
        near = not pace.missed or expected.window is None or expected.window[1] < FARTHEST
        fits = fit(scan, view, expected, sure) if telling and near else []
        if fits and expected.window and fits[0].share < FAMILIAR:  # it may have turned far
            window = (*expected.window[:2], math.pi)
            fits = fit(scan, view, expected._replace(window=window), sure)
        if state.lost and len(fits) > 1:  # two places alike: neither is told
            fits = [fits[0]._replace(share=0.0)]
        if state.carried and state.lost > BRIEFLY:  # what is alike elsewhere is for the whole map
            fits = []
        here, good = [], []
        for one in fits:
            usual = blind and expected.square(one.pose) < scan_fit.UNUSUAL
            way = float(np.hypot(*(one.pose - state.belief.pose)[:2])) if gone else 0.0
            away = bool(state.lost) or way > FARTHER * state.habits.reach[0]
            astray = away and not (gone <= BRIEFLY and usual)
            astray |= blind and bool(abs(one.pose[2] - state.belief.pose[2]) > ABOUT)
            untold = blind and away and _off(one.covariance, FIRM)  # not found again
            untold |= pace.missed > 0 and one.scale > NARROW  # it is farther away than was looked
            if untold or self._elsewhere(one, ranges, view, astray):
                continue
            here.append(one)
            enough = FOUND if astray else max(least * (1 - one.unseen * blind), NONE)
            good += [one] * (one.share >= enough)
        told = max((one.told for one in good), default=-math.inf)
        content = max((one.share for one in good), default=0.0) >= CONTENT
        denied, went = list[Fit](), came._replace(moved=moved - before)
        if telling and not (blind or content or state.lost > BRIEFLY):
            denied, alone = self._denied(state, scan, view, went, fit)
            if denied and denied[0].told - AGAINST * (not state.denied) > told:
                good, ahead, blind = denied, alone, True
        state = state._replace(denied=good is denied)
        way = math.nan if blind else float(np.hypot(*(moved - before)[:2]))
        for one in good:
            ring = state.map if one is good[-1] else copied(state.map)
            yield *self._matched(state._replace(map=ring), scan, one, ahead, way), one.worth
        if not good:
            share = max((one.share for one in here), default=0.0)
            through = len(here) < len(fits)
            state = state._replace(carried=state.carried or (through and not blind))
            carried = blind or through
            worth = math.log(UNSEEN) * scan_fit.SOME / scan_fit.ALIKE if telling else 0.0
            yield *self._unmatched(state, scan if telling else None, ahead, carried, share), worth

    def _denied(
        self, state: Following, scan: Surface, view: Known, went: Came, fit: Matching
    ) -> tuple[list[Fit], Belief]:
        """Where a scan fits well, had the wheels said nothing; and what was expected then."""
        ranges, moved, dt = went
        gyro = moved * [np.nan, np.nan, np.nan, 1.0]
        ahead, expected = _expected(state, gyro, True, dt, state.lost)
        expected = expected._replace(shared=max(state.often, state.since) - 1)
        fits = [one for one in fit(scan, view, expected, SURE) if one.share >= FAMILIAR]
        usual = [one for one in fits if expected.square(one.pose) < scan_fit.UNUSUAL]
        return [one for one in usual if not self._elsewhere(one, ranges, view, True)], ahead

    def _unmatched(
        self, state: Following, scan: Surface | None, ahead: Belief, carried: bool, share: float
    ) -> tuple[Following, Row]:
        """By the wheels alone for a while, unless they do not tell either (``carried``)."""
        state, spread = state._replace(belief=ahead), ahead.covariance[:3, :3]
        if not (carried or state.lost or _off(spread, FAR)):
            d = between(state.map.newest, ahead.pose)
            new = math.hypot(d[0], d[1]) > 2 * APART or abs(d[2]) > 2 * TURNED
            ring = joined(state.map, scan, ahead.pose) if scan is not None and new else state.map
            state = state._replace(map=ring, lost=0, pace=state.pace.found)
            return state, Row(ahead.pose, spread, Fix.PREDICTED, share, state.segment)
        state = state._replace(lost=state.lost + 1)
        if scan is not None and state.lost > PATIENCE:
            state = state._replace(map=empty(self.beams), segment=state.segment + 1)
            return self._begun(state, scan, True)
        return state, Row(share=share, segment=state.segment)

    def _elsewhere(self, fit: Fit, ranges: Vector, view: Known, lost: bool) -> bool:
        """Is the robot elsewhere than where its scan fits best?"""
        if fit.share >= FAMILIAR and not lost:
            return False
        lidar = compose(fit.pose, np.array(self.lidar.mount))
        through = contradicted(ranges, self.angles, lidar, view.points)
        return through > (AGAIN if lost else THROUGH) or (lost and _off(fit.covariance, FIRM))

    def _begun(
        self, state: Following, scan: Surface, telling: bool, known: np.ndarray = UNKNOWN
    ) -> tuple[Following, Row]:
        """The first scan of a map, where it says that it is; ``known``: where in the one before."""
        if not telling:
            return state, Row(segment=state.segment)
        pose = state.belief.pose
        state = state._replace(
            map=joined(state.map, scan, pose), lost=0, pace=state.pace.found, open=0, carried=False,
            belief=state.belief.moved(state.belief.t, pose, np.zeros((3, 3))),
        )  # fmt: skip
        row = Row(pose.copy(), scan_fit.COMMON.copy(), Fix.MATCHED, 1.0, state.segment)
        return state, row._replace(sighting=Sighting(pose, known))

    def _matched(
        self, state: Following, scan: Surface, fit: Fit, ahead: Belief, way: float
    ) -> tuple[Following, Row]:
        blind, last = math.isnan(way), state.belief.covariance
        if blind:
            ahead = ahead.moved(ahead.t, ahead.pose, ahead.covariance[:3, :3] + fit.others)
        found = measured(ahead, fit.sighting, 0.0 if blind else way)
        pose, spread = found.belief.pose, found.belief.covariance[:3, :3] + scan_fit.COMMON
        d = between(state.map.newest, pose)
        moved = math.hypot(d[0], d[1]) > APART or abs(d[2]) > TURNED
        ring = state.map
        if moved or fit.share < FAMILIAR:
            ring = joined(ring, scan, pose)
            often = state.often + OFTEN * (state.since - state.often)
            state = state._replace(since=0, often=often)
        step = between(state.belief.pose, pose)
        habits = state.habits
        if not (state.lost or _off(spread, FIRM)):  # else it is what was expected
            habits = habits.learnt(step)
        state = state._replace(
            map=ring, belief=found.belief, habits=habits, lost=0, carried=False,
            pace=state.pace.found,
        )  # fmt: skip
        row = Row(
            pose.copy(), spread, Fix.MATCHED, fit.share, state.segment, fit.sighting,
            found.slip or state.denied, found.belief.scale,
        )  # fmt: skip
        if _off(spread, OPEN if blind else FAR):  # walls alike all along the way
            left = blind and fit.share < FAMILIAR  # what joined the map is not tied to it
            state = state._replace(open=max(state.open, PATIENCE * left) + 1)
            row = Row(share=fit.share, segment=state.segment)
            if blind and state.open > PATIENCE and not left:  # it may have moved on
                state = state._replace(map=joined(ring, scan, pose))
            if blind:  # what follows may tell the rest
                row = row._replace(sighting=Sighting(pose.copy(), np.linalg.inv(spread)))
            return state, row
        if blind and state.open > PATIENCE:
            about = np.linalg.inv(state.open * last[:3, :3] + scan_fit.COMMON)  # errs alike
            state = state._replace(map=empty(self.beams), segment=state.segment + 1)
            return self._begun(state, scan, True, about)
        return state._replace(open=0), row


def _decided(scan: Surface, view: Known, expected: Expected, sure: float) -> list[Fit]:
    return [scan_fit.best(scan, view, expected, sure)]


def _off(covariance: np.ndarray, limit: float) -> bool:
    """Is a place more uncertain than ``limit`` [m]?"""
    return bool(covariance[0, 0] + covariance[1, 1] > limit * limit)


def _blind(moved: Motion) -> bool:
    """Do the wheels say nothing?"""
    return not bool(np.all(np.isfinite(moved[:3])))


def _expected(
    state: Following, went: Motion, blind: bool, dt: float, gone: int
) -> tuple[Belief, Expected]:
    """By wheels and gyro, else by the last step again: robots go on more often than they start or
    stop. ``gone``: scans without a pose before it."""
    lasts = round(1e9 * dt)
    if blind:
        steps, weights = state.habits.known()
        way = state.habits.spread
        sigma = np.array([way, way, FREE * min(max(dt / SLOW, 1.0), LONG)])
        if math.isfinite(went[3]):
            steps[:, 2], sigma[2] = went[3] - state.belief.bias * dt, AT_REST[2]
        at = state.belief
        spread = at.covariance[:3, :3] + np.diag((sigma * (1 + gone)) ** 2)
        places = compose(np.broadcast_to(at.pose, steps.shape), steps)
        far, turn = state.habits.reach
        half = FARTHER * (1 + gone) * far + scan_fit.WINDOW * way
        widest = scan_fit.WIDEST * (1 + far) if gone == state.lost else FARTHEST
        turn = max(FARTHER * (1 + gone) * turn, scan_fit.WINDOW * sigma[2], ABOUT)
        window = at.pose, min(half, widest), min(turn, math.pi)
        likely = Expected(at.pose, spread, window, places, weights)
        likely = likely._replace(pose=places[likely.densities(places).sum(axis=1).argmax()])
        return at.moved(at.t + lasts, likely.pose, spread), likely
    wheels = between(state.moved[:3] - went[:3], state.moved[:3])
    ahead = predicted(state.belief, Step(lasts, wheels, float(went[3])))
    way, turn = math.hypot(wheels[0], wheels[1]), abs(wheels[2])
    sigma = (AT_REST + SHARE * np.array([way, way, turn])) * (1 + gone)
    return ahead, Expected(ahead.pose, ahead.covariance[:3, :3] + np.diag(sigma * sigma))
