"""Scans to poses while they come: the scan matcher of a running twin, with wheels and gyro.

A scan waits until wheels and gyro have spoken past its stamp, so that their word for it lies
between two; not for longer than they may be `silent`: then it is matched without, and they are not
waited for until they are heard again. So it hardly matters in which order the sensors arrive, and
recorded or live, in whatever pieces, the poses are the same bit for bit. A pose is told where a
scan tells it; else its numbers are NaN, which makes the row's outputs absent: the wheels alone are
no measurement of the place. What was lost, found, missing or unheard is told as an event.

>>> from evertwin.sources.columns.scans import Lidar
>>> lidar = Lidar.ahead(120, np.radians(2.0), 30.0)
>>> wall = 2.0 / np.abs(np.cos(lidar.angles(120) / 1.5)) + 0.2 * np.cos(3 * lidar.angles(120))
>>> stage = Perception("scan", lidar, 120)
>>> scans = Chunk("scan", np.arange(3) * 10**8, np.tile(wall, (3, 1)))
>>> stage.step(stage.init(), scans)[1].rows.pose[-1].round(2).tolist()
[0.0, 0.0, -0.0]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.features.placed import Said
from evertwin.features.scans.poses import Fix, Poses
from evertwin.features.scans.range_unit import LONGEST, doubted, middle
from evertwin.features.scans.repeats import Repeats
from evertwin.features.scans.scan_matcher import FEW, STANDING, Following, ScanMatcher
from evertwin.features.scans.words import NEVER, Words
from evertwin.features.tables.furniture import FURNISHED, UNKNOWN, Furnishing, Furniture
from evertwin.features.tables.legs import View
from evertwin.fold import Chunk, Out, make_block
from evertwin.signals.planar import compose, wrapped
from evertwin.sources.columns.scans import Lidar
from evertwin.types import Float64, Int64, Vector

WAITING = 32
"""Scans that may wait; the oldest of more is matched with what was said."""
LOST = 3
"""Scans in a row without a pose that are told of."""
MISSING, LEARNS = 5.0, 0.1
"""Usual steps from scan to scan that are a hole, and how much one tells of what is usual."""
CAUSES = FROZEN, UNIT = "scans_frozen", "unit_doubted"
PERCEIVED = ("pose_lost", "pose_found", "scans_missing", *CAUSES, "unheard", "heard",
             *FURNISHED)  # fmt: skip
"""Kinds of its events; those that say why there is no pose, each once."""
WHEELS, GYRO = 0, 1
NOT_YET, HEARD, UNHEARD = 0, 1, 2


class PerceptionState(NamedTuple):
    """State of `Perception`.

    >>> Perception("scan", Lidar(0.0, 0.1, 9.0), 60).init().ranges.shape
    (32, 60)
    """

    following: Following
    t: Int64[np.ndarray, " waiting"]
    """Stamps of the scans that wait, in a ring [ns]."""
    ranges: Float64[np.ndarray, "waiting beams"]
    came: int
    """Scans so far."""
    read: int
    """Those of them that do not wait any more."""
    wheels: Words
    """x, y, heading."""
    gyro: Words
    """Its angle and rate, and how often it was silent before."""
    heard: Int64[np.ndarray, " two"]
    """`NOT_YET`, `HEARD` or `UNHEARD` at the last scan: wheels, gyro."""
    silences: int
    """Of the gyro, up to the last scan."""
    newest: int
    """Newest stamp of all [ns]."""
    before: int
    """Stamp of the last scan that was matched [ns]."""
    usual: float
    """Time from scan to scan [ns]."""
    without: int
    """Scans since there was a pose."""
    since: int
    """Stamp of the first of them [ns]."""
    told: int
    """Number of the time (`Perception.every`) in which a pose was told last."""
    late: int
    """Scans that came out of order since the last that did not."""
    segment: int
    """Of the map of the last scan."""
    left: int
    """In which it was told before there was none."""
    repeats: Repeats
    doubted: bool
    """Was it told that the unit of its ranges is doubted?"""
    task: int
    furniture: Furniture | tuple[()] = ()
    """Empty where no tables are asked for."""


@dataclass(frozen=True)
class Perception:
    """The stage: implements `evertwin.fold.Online` over chunks of scans, wheels and gyro, each in
    SI and (n, beams), (n, 3), (n, 1). See the module for an example."""

    scan: str
    """Name of the source of scans."""
    lidar: Lidar
    beams: int
    wheels: str = ""
    """Of the wheels' pose; empty: there is none."""
    gyro: str = ""
    """Of the turn rate."""
    silent: float = 1.0
    """How long a scan waits for these, and how long they may say nothing [s]."""
    within: float = 0.1
    """Standard deviation of the place from which on a pose is none [m]."""
    every: float = 0.0
    """A pose is told for the first scan of each such time; 0: for every one [s]."""
    drives: tuple[str, ...] = ()
    """Sources of inputs that drive the machine; none: nobody says whether it drives."""
    unit: str = "m"
    """That is declared for the ranges."""
    tables: int = 0
    """Places for tables."""

    @cached_property
    def _furnishing(self) -> Furnishing:
        return Furnishing(self.lidar, self.tables)

    @cached_property
    def _matcher(self) -> ScanMatcher:
        return ScanMatcher(self.lidar, self.beams)

    @property
    def _unfurnished(self) -> Furniture | tuple[()]:
        return self._furnishing.init(self.beams) if self.tables else ()

    @cached_property
    def _silent(self) -> int:
        return round(1e9 * self.silent)

    def init(self) -> PerceptionState:
        """Nothing was seen or heard yet."""
        return PerceptionState(
            self._matcher.init(), np.zeros(WAITING, np.int64), np.zeros((WAITING, self.beams)), 0,
            0, Words.none(3), Words.none(3), np.zeros(2, np.int64), 0, NEVER, NEVER, 0.0, 0, NEVER,
            NEVER, 0, 0, 0, Repeats.none(len(self.drives)), False, 0, self._unfurnished,
        )  # fmt: skip

    def step(self, state: PerceptionState, block: Chunk) -> tuple[PerceptionState, Out]:
        """More of one source; a later task is another drive, and begins anew.

        Raises:
            DataError: it has another number of values.
        """
        self.check(block)
        state, out = self._opened(state, block.task)
        if block.task < state.task:
            return state, out.out
        for t, v in zip(block.t.tolist(), block.v, strict=True):
            if block.source == self.scan:
                state = self._seen(state, t, v, out)
            elif block.source in self.drives:
                k = self.drives.index(block.source)
                state = state._replace(repeats=state.repeats.driven(k, t, v))
            elif block.source == self.wheels:
                state = _moved(state, t, v)
            else:
                state = _turned(state, t, float(v[0]), self._silent)
            state = self._read(state._replace(newest=max(state.newest, t)), out)
        return state, out.out

    def opened(self, state: PerceptionState, task: int) -> tuple[PerceptionState, Out]:
        """A later task begins: the scans that wait are matched."""
        state, out = self._opened(state, task)
        return state, out.out

    def _opened(self, state: PerceptionState, task: int) -> tuple[PerceptionState, Said]:
        out = Said()
        if task <= state.task:
            return state, out
        self._read(state, out, ends=True)
        return self.init()._replace(task=task), out

    def flush(self, state: PerceptionState) -> tuple[PerceptionState, Out]:
        """The scans that wait, at the end of the data."""
        out = Said()
        state = self._read(state, out, ends=True)
        return state, out.out

    def check(self, chunk: Chunk) -> None:
        """Has a chunk the shape of its source?

        Raises:
            DataError: it has another one.
        """
        widths = {self.scan: self.beams, self.wheels: 3, self.gyro: 1}
        width = widths.get(chunk.source, chunk.v.shape[-1])
        if chunk.v.shape != (len(chunk.t), width):
            raise DataError(
                f"source {chunk.source!r}: expected {width} values, got {chunk.v.shape[1:]}"
            )

    def _seen(self, state: PerceptionState, t: int, ranges: Vector, out: Said) -> PerceptionState:
        """A scan joins those that wait."""
        last = int(state.t[(state.came - 1) % WAITING]) if state.came else NEVER
        if t <= last:
            return state._replace(late=state.late + 1)
        if state.late:
            what = "scans came out of order or twice: left out"
            out.tell(t, "late", self.scan, f"{self.scan}: {state.late} {what}", samples=state.late)
        if state.came - state.read == WAITING:
            state = self._one(state, out)
        place = state.came % WAITING
        measured = np.isfinite(ranges) & (ranges > 0.0)
        state.t[place], state.ranges[place] = t, np.where(measured, ranges, np.nan)
        return state._replace(came=state.came + 1, late=0)

    def _read(self, state: PerceptionState, out: Said, *, ends: bool = False) -> PerceptionState:
        """Matches the scans that have waited."""
        while state.read < state.came:
            t = int(state.t[state.read % WAITING])
            words = [one.newest for _, one in self._priors(state)]
            waited = any(t - self._silent <= newest < t for newest in words)
            if waited and not ends and state.newest < t + self._silent:
                break
            state = self._one(state, out)
        return state

    def _priors(self, state: PerceptionState) -> Iterator[tuple[int, Words]]:
        if self.wheels:
            yield WHEELS, state.wheels
        if self.gyro:
            yield GYRO, state.gyro

    def _one(self, state: PerceptionState, out: Said) -> PerceptionState:
        """The pose of the scan that has waited longest."""
        place = state.read % WAITING
        t = int(state.t[place])
        state = self._missed(state, t, out)
        state, moved = self._said(state, t, out)
        before = None if state.before == NEVER else state.before
        ranges = self._measured(state.ranges[place])
        state = self._again(state, t, ranges, out)
        block = make_block(t=[t], u=moved[None], y=ranges[None], before=before)
        following, found = self._matcher.step(state.following, block)
        poses: Poses = found.rows
        place_sd = np.sqrt(poses.covariance[0, 0, 0] + poses.covariance[0, 1, 1])
        segment = int(poses.segment[0])
        anew = state.without and segment != state.segment  # a map that begins has any scan placed
        told = poses.fix[0] == Fix.MATCHED and place_sd <= self.within and not anew
        pose = poses.pose[0] if told else np.full(3, np.nan)
        if self.tables:
            lidar = compose(pose, np.array(self.lidar.mount))
            state = self._furnished(state, View(t, ranges, self.lidar, lidar), segment, out)
        now = t if self.every == 0.0 else t // round(1e9 * self.every)
        if now > state.told:
            room = state.furniture
            stand = room.places.ravel().copy() if isinstance(room, Furniture) else np.zeros(0)
            out.rows.append((t, pose, segment, state.task, stand))
            state = state._replace(told=now if told else state.told)
        state = self._found(state, t, segment, out) if told else self._lost(state, t, out)
        return state._replace(following=following, read=state.read + 1, before=t, segment=segment)

    def _furnished(
        self, state: PerceptionState, view: View, segment: int, out: Said
    ) -> PerceptionState:
        """The tables after a scan; on a new map none is known."""
        room = state.furniture
        assert isinstance(room, Furniture)
        if segment != state.segment:
            if room.numbers.any():
                what = "on a new map it is not known where the tables stand: the model has none"
                out.tell(view.t, UNKNOWN, self.scan, f"{self.scan}: {what}", tables=room.numbers)
            room = self._furnishing.init(self.beams)._replace(last=room.last)
        if np.isfinite(view.pose).all():
            room, told = self._furnishing.step(room, view)
            for one in told:
                out.tell(view.t, one.kind, self.scan, one.reason, **one.evidence)
        return state._replace(furniture=room)

    def _missed(self, state: PerceptionState, t: int, out: Said) -> PerceptionState:
        """Were scans missing before this one?"""
        if state.before == NEVER:
            return state
        step = t - state.before
        if state.usual and step > max(MISSING * state.usual, self._silent):
            what = f"{self.scan}: no scan for {1e-9 * step:.4g} s: no pose meanwhile"
            out.tell(t, "scans_missing", self.scan, what, first=state.before, last=t)
        usual = state.usual or float(step)
        return state._replace(usual=usual + LEARNS * (min(step, MISSING * usual) - usual))

    def _said(self, state: PerceptionState, t: int, out: Said) -> tuple[PerceptionState, Vector]:
        """What wheels and gyro say of a time: x, y, heading, angle; NaN where they say nothing."""
        moved = np.full(4, np.nan)
        for k, words in self._priors(state):
            found = words.at(t, self._silent)
            if k == WHEELS and found is not None:
                moved[:3] = found
            elif found is not None:
                if int(found[2]) == state.silences:
                    moved[3] = found[0]
                state = state._replace(silences=int(found[2]))
            name, before = (self.wheels, self.gyro)[k], state.heard[k]
            if found is None and before == HEARD:
                what = f"{name}: nothing is said at the scans, which are matched without from here"
                out.tell(t, "unheard", name, what)
                state.heard[k] = UNHEARD
            if found is not None:
                if before == UNHEARD:
                    out.tell(t, "heard", name, f"{name}: heard again")
                state.heard[k] = HEARD
        return state, moved

    def _measured(self, ranges: Vector) -> Vector:
        """Those that the lidar can have measured."""
        longest = self.lidar.longest if not middle(ranges) > LONGEST else 0.0
        return np.where(ranges < longest, ranges, np.nan)

    def _again(self, state: PerceptionState, t: int, ranges: Vector, out: Said) -> PerceptionState:
        """Is a scan the one before, number by number?"""
        last = state.following.ranges
        same = np.isfinite(ranges).sum() >= FEW and np.array_equal(ranges, last, equal_nan=True)
        repeats = state.repeats.after(bool(same), state.before, t)
        if repeats.again == STANDING:
            what = f"{self.scan}: {repeats.said}"
            out.tell(t, FROZEN, self.scan, what, first=repeats.since, last=t)
        following = state.following._replace(repeated=STANDING * repeats.frozen)
        return state._replace(repeats=repeats, following=following)

    def _found(self, state: PerceptionState, t: int, segment: int, out: Said) -> PerceptionState:
        if state.without >= LOST:
            what = f"the scans tell the pose again after {1e-9 * (t - state.since):.4g} s without"
            if segment != state.left:
                what += ", on a new map: where that lies is not known, poses before and after are "
                what += "not of one frame"
            evidence = {"first": state.since, "last": t, "segment": segment}
            out.tell(t, "pose_found", self.scan, what, **evidence)
        return state._replace(without=0)

    def _lost(self, state: PerceptionState, t: int, out: Said) -> PerceptionState:
        if not state.without:
            state = state._replace(since=t, left=state.segment)
        state = state._replace(without=state.without + 1)
        if state.without == LOST:
            what = f"{LOST} scans in a row tell no pose: there is none until one does"
            out.tell(t, "pose_lost", self.scan, what, first=state.since, last=t)
        if state.without >= LOST and not state.doubted:
            ranges = state.ranges[state.read % WAITING]
            if why := doubted(ranges, self.unit):
                what = f"{self.scan}: {why}: in [perception] it is '{self.unit}' now"
                out.tell(t, UNIT, self.scan, what, first=state.since, last=t)
                state = state._replace(doubted=True)
        return state


def _moved(state: PerceptionState, t: int, v: Vector) -> PerceptionState:
    """A word of the wheels; one out of order, or without numbers, is none."""
    words = state.wheels
    if t <= words.newest or not np.isfinite(v).all():
        return state
    pose = v.copy()
    if words.spoken:
        last = words.v[(words.spoken - 1) % len(words.t), 2]
        pose[2] = last + float(wrapped(v[2:] - last)[0])
    return state._replace(wheels=words.said(t, pose))


def _turned(state: PerceptionState, t: int, rate: float, silent: int) -> PerceptionState:
    """A word of the gyro, whose rates add up to an angle; not over a silence."""
    words = state.gyro
    if t <= words.newest or not np.isfinite(rate):
        return state
    word = np.array([0.0, rate, 0.0])
    if words.spoken:
        angle, last, silences = words.v[(words.spoken - 1) % len(words.t)]
        dt = t - words.newest
        word[0] = angle + (0.5 * (last + rate) * dt * 1e-9 if dt <= silent else 0.0)
        word[2] = silences + (dt > silent)
    return state._replace(gyro=words.said(t, word))
