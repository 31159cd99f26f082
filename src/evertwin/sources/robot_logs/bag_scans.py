"""The scans of a bag: `LaserScan` (or `MultiEchoLaserScan`, its first echo), and what moves it.

Odometry is the first topic of `Odometry` in a frame of wheels, else the transform from such a frame
on ``/tf``; the gyro is the first `Imu`. ``/tf`` and ``/tf_static`` say where the lidar is on the
machine. What states a pose in a map (`PoseWithCovarianceStamped`, `PoseStamped`, an `Odometry` in
the frame of a map) is never used but to be scored against.

>>> one = Shot(0.0, 0.1, 0.05, 10.0, 0.0, np.array([1.0, 0.0, 12.0]))
>>> one.ranges_on(0.0, 0.1, 3).tolist()
[1.0, nan, nan]
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.signals.planar import between
from evertwin.sources.columns.names import closest
from evertwin.sources.columns.scans import (
    Lidar,
    Poses,
    Scans,
    Track,
    at_stamps,
    ceiling,
    increasing,
)
from evertwin.sources.columns.table import Recording
from evertwin.sources.robot_logs.bag_files import Cut, Message, messages
from evertwin.sources.robot_logs.bag_tracks import (
    OTHER,
    Clocked,
    Frames,
    Link,
    Moved,
    Stamped,
    clocked,
    heading,
    number,
    part,
    pose_of,
    rate_of,
    track,
)
from evertwin.sources.robot_logs.bags import TopicTable
from evertwin.sources.robot_logs.ros_messages import Decoder, stamp_of
from evertwin.types import Stamps, Vector

BAGS = ("mcap", "ros1", "ros2")
LEVEL = math.cos(math.radians(10.0))
"""Cosine of the tilt up to which a lidar looks along the floor."""
SAME = 1e-3
"""Poses that never differ by more are one [m, rad]."""
MOST = 1 << 28
"""Ranges that are read at most."""


class Shot(NamedTuple):
    """One scan as its message has it."""

    start: float
    step: float
    nearest: float
    longest: float
    sweep: float
    ranges: Vector

    def ranges_on(self, start: float, step: float, beams: int) -> Vector:
        """Its ranges at the angles of another scan [m]; NaN where nothing came back."""
        r = np.where(self.ranges > max(self.nearest, 0.0), self.ranges, np.nan)
        r[~(r < self.longest)] = np.nan
        r[~np.isfinite(r)] = np.nan
        if len(r) == beams and max(abs(self.start - start), abs(self.step - step) * beams) < 1e-3:
            return r
        at = np.rint((start + step * np.arange(beams) - self.start) / self.step)
        inside = (at >= 0) & (at < len(r))
        return np.where(inside, r[np.clip(at, 0, len(r) - 1).astype(np.int64)], np.nan)


@dataclass
class _Topic:
    """The scans of one topic."""

    frame: str = ""
    rows: list[Stamped] = field(default_factory=list)
    shots: list[Shot] = field(default_factory=list)
    damaged: int = 0
    values: int = 0


@dataclass
class _Heard:
    """What a bag says of scans and motion."""

    lidars: dict[str, _Topic] = field(default_factory=dict)
    poses: dict[str, Moved] = field(default_factory=dict)
    gyros: dict[str, Moved] = field(default_factory=dict)
    frames: Frames = field(default_factory=Frames)

    def take(self, message: Message, decoder: Decoder, wanted: str) -> None:
        kind = message.connection.type.rpartition("/")[2]
        topic = message.connection.topic
        scan = kind in _LASERS
        if (not scan and kind not in _MOTION) or (scan and wanted and topic != wanted):
            if scan:
                self.lidars.setdefault(topic, _Topic())
            return
        try:
            content = decoder.content(message)
        except DataError:
            if scan:
                self.lidars.setdefault(topic, _Topic()).damaged += 1
            return
        if scan:
            self._scan(self.lidars.setdefault(topic, _Topic()), content, message)
        elif kind.lower() == "tfmessage":
            self.frames.take(content, message.time)
        else:
            self._moved(topic, content, message)

    def _scan(self, lidar: _Topic, content: Any, message: Message) -> None:
        shot = _shot(content)
        if shot is None:
            lidar.damaged += 1
            return
        lidar.values += len(shot.ranges)
        if lidar.values > MOST:
            raise DataError(
                f"{message.connection.topic}: more than {MOST} ranges: cut the bag into parts"
            )
        lidar.frame = lidar.frame or str(part(content, "header.frame_id") or "")
        lidar.rows.append(Stamped(stamp_of(content), message.time, ()))
        lidar.shots.append(shot)

    def _moved(self, topic: str, content: Any, message: Message) -> None:
        gyro = part(content, "angular_velocity") is not None
        frame, child = (
            str(part(content, name) or "").lstrip("/")
            for name in ("header.frame_id", "child_frame_id")
        )
        told = (self.gyros if gyro else self.poses).setdefault(topic, Moved(topic, frame, child))
        values = rate_of(content) if gyro else pose_of(content)
        told.rows.append(Stamped(stamp_of(content), message.time, values))


_LASERS = ("LaserScan", "MultiEchoLaserScan")
_MOTION = ("Odometry", "Imu", "TFMessage", "tfMessage", "PoseStamped", "PoseWithCovarianceStamped")


def _shot(content: Any) -> Shot | None:
    """A message as a scan; None where it is none."""
    ranges = part(content, "ranges")
    if ranges is None or len(ranges) < 2:
        return None
    if part(ranges[0], "echoes") is not None:
        ranges = [next(iter(part(one, "echoes")), math.nan) for one in ranges]
    values = np.array([math.nan if one is None else one for one in ranges], dtype=np.float64)
    start, step = number(content, "angle_min"), number(content, "angle_increment")
    if not (math.isfinite(step) and step):
        step = (number(content, "angle_max") - start) / (len(values) - 1)
    if not (math.isfinite(start) and math.isfinite(step) and step):
        return None
    near, far = (number(content, name) for name in ("range_min", "range_max"))
    far = far if math.isfinite(far) and far > 0 else math.inf
    sweep = number(content, "time_increment")
    return Shot(start, step, near if near > 0 else 0.0, far, sweep if sweep > 0 else 0.0, values)


def scans_of(recording: Recording, scan: str = "", odometry: str = "") -> tuple[Scans, ...]:
    """The scans of a recording: of each of its lidars, or of the topic ``scan`` alone.

    Args:
        recording: of any kind.
        scan: topic; empty: all.
        odometry: topic of the odometry; empty: the first of wheels.

    Raises:
        UsageError: no such topic.
        DataError: the lidar does not look along the floor.
    """
    if recording.kind not in BAGS:
        found = tuple(one for one in recording.scans if scan in ("", one.name))
        return found or _absent("scans", scan, [one.name for one in recording.scans])
    heard, decoder = _Heard(), Decoder()
    table = recording.tables[0]
    assert isinstance(table, TopicTable)
    if not (scan or odometry or _scanned(table)):
        return ()
    for file, kind in table.files:
        for message in messages(file, kind):
            if not isinstance(message, Cut):
                heard.take(message, decoder, scan)
    if scan not in heard.lidars:
        _absent("scans", scan, list(heard.lidars))
    if odometry not in heard.poses:
        _absent("odometry", odometry, list(heard.poses))
    topics = heard.lidars.items()
    return tuple(_scans(name, one, heard, odometry) for name, one in topics if one.shots)


def _scanned(table: TopicTable) -> bool:
    """Does the bag hold scans? Else what moves a lidar is not decoded."""
    return any(
        not isinstance(message, Cut) and message.connection.type.rpartition("/")[2] in _LASERS
        for file, kind in table.files for message in messages(file, kind)
    )  # fmt: skip


def _absent(what: str, name: str, known: list[str]) -> tuple[Scans, ...]:
    if name:
        raise UsageError(f"no {what} on {name!r}: {closest(name, known)}")
    return ()


def _scans(name: str, lidar: _Topic, heard: _Heard, odometry: str) -> Scans:
    clock, order, said = _ordered(clocked(lidar.rows))
    shots = [lidar.shots[k] for k in order]
    counts = np.array([len(shot.ranges) for shot in shots])
    usual = int(np.bincount(counts).argmax())
    first = shots[int(np.argmax(counts == usual))]
    if (counts != usual).any():
        said.append(f"{int((counts != usual).sum())} of {len(shots)} scans have not {usual} beams: "
                    "each beam by its nearest angle")  # fmt: skip
    if lidar.damaged:
        said.append(f"{lidar.damaged} messages cannot be read: left out")
    ranges = np.array([shot.ranges_on(first.start, first.step, usual) for shot in shots])
    longest = first.longest if math.isfinite(first.longest) else ceiling(ranges)
    ranges[~(ranges < longest)] = np.nan
    wheels, gyro, more = _motion(heard, odometry, clock.offset)
    link = _mount(name, lidar, heard, wheels, said)
    stated, also = _stated(heard, clock, wheels)
    beside = None
    if wheels is not None and also:
        said.append(
            f"odometry {wheels.name} equals {also} at every scan: it is a reference, or the "
            "reference is odometry; it is not used as odometry"
        )
        wheels = None
    if wheels is not None:
        beside = at_stamps(clock.t, wheels.t, wheels.values)
    return Scans(
        name, clock.t, ranges, _lidar(first, link, longest, clock.t), beside, stated, True,
        (*said, *more), wheels, gyro, clock.arrived,
    )  # fmt: skip


def _lidar(first: Shot, link: Link, longest: float, t: Stamps) -> Lidar:
    flip = -1.0 if link.turn[2, 2] < 0 else 1.0
    period = 1e-9 * float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    whole = first.sweep * len(first.ranges)
    sweep = first.sweep if 0.1 * period <= whole <= 1.1 * period else 0.0
    mount = (float(link.place[0]), float(link.place[1]), heading(link.turn))
    return Lidar(flip * first.start, flip * first.step, longest, mount, sweep)


def _ordered(clock: Clocked) -> tuple[Clocked, np.ndarray, list[str]]:
    """The scans in the order of their stamps, and what was wrong with these."""
    said = []
    n = len(clock.t)
    if clock.mended:
        said.append(f"{clock.mended} of {n} stamps are absent or cannot be: told from the logging")
    if 2 * increasing(clock.t).sum() < n:
        said.append("most stamps repeat or go back: the times of logging are used")
        logged = clock.arrived - (clock.offset if abs(clock.offset) >= OTHER else 0)
        clock = clock._replace(t=logged, arrived=logged, offset=0)  # such stamps are no clock
    late = clock.t < np.maximum.accumulate(clock.t)
    if late.any():
        by = 1e-9 * float((np.maximum.accumulate(clock.t) - clock.t).max())
        said.append(f"{int(late.sum())} of {n} scans came out of order, by up to {by:.3g} s: "
                    "sorted by their stamps")  # fmt: skip
    t, order = np.unique(clock.t, return_index=True)
    if len(t) < n:
        said.append(f"{n - len(t)} of {n} scans repeat the stamp of another one: left out")
    return clock._replace(t=t, arrived=clock.arrived[order]), order, said


def _motion(heard: _Heard, named: str, offset: int) -> tuple[Track | None, Track | None, list[str]]:
    """Odometry and gyro on the clock of the scans, and what is to be said of them."""
    said: list[str] = []
    found = [one for one in heard.poses.values() if one.child and not one.reference]
    if named:
        found = [heard.poses[named]]
    found = found or [Moved(f"/tf ({child})", "odom", child, rows)
              for child, rows in heard.frames.wheels.items() if len(rows) > 1]  # fmt: skip
    if len(found) > 1:
        others = ", ".join(one.name for one in found[1:])
        said.append(f"odometry of {found[0].name}; there is {others} besides")
    wheels = track(found[0], offset) if found else None
    gyro = None
    for one in heard.gyros.values():
        link = heard.frames.on(one.frame, found[0].child if found else "")
        up = np.array([0.0, 0.0, 1.0]) if link is None else link.turn[2]
        rows = [row._replace(values=(float(up @ row.values),)) for row in one.rows]
        gyro = track(replace(one, rows=rows), offset)
        break
    if gyro is not None and not np.ptp(gyro.values):
        said.append(f"gyro {gyro.name} always says the same: not used")
        gyro = None
    return wheels, gyro, said


def _mount(name: str, lidar: _Topic, heard: _Heard, wheels: Track | None, said: list[str]) -> Link:
    """Where the lidar is on the machine.

    Raises:
        DataError: it does not look along the floor.
    """
    base = ""
    if wheels is not None:
        told = heard.poses.get(wheels.name)
        base = told.child if told is not None else wheels.name[5:-1]
    link = heard.frames.on(lidar.frame, base)
    if link is None:
        if wheels is not None:
            said.append(f"/tf does not place {lidar.frame or 'the lidar'!r} on {base!r}: taken to "
                        "be there, level and looking ahead")  # fmt: skip
        return Link(base, np.eye(3), np.zeros(3))
    if abs(link.turn[2, 2]) < LEVEL:
        tilt = math.degrees(math.acos(min(abs(link.turn[2, 2]), 1.0)))
        raise DataError(
            f"{name}: by /tf its lidar is tilted by {tilt:.0f}°: expected one that looks along "
            "the floor"
        )
    if link.turn[2, 2] < 0:
        said.append("by /tf the lidar hangs upside down: its beams are taken the other way round")
    return link


def _stated(heard: _Heard, clock: Clocked, wheels: Track | None) -> tuple[Poses | None, str]:
    """Poses of a map at the scans, and the topic whose poses are the odometry's again."""
    stated = None
    for one in heard.poses.values():
        told = track(one, clock.offset)
        if told is None or not one.reference or (wheels is not None and one.name == wheels.name):
            continue
        at = at_stamps(clock.t, told.t, told.values)
        if wheels is not None and _same(at_stamps(clock.t, wheels.t, wheels.values), at):
            return at, one.name
        stated = at if stated is None else stated
    return stated, ""


def _same(one: Poses, other: Poses) -> bool:
    """Are these the same way, told from its first pose, and does it move at all?"""
    both = np.flatnonzero(np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1))
    if len(both) < 3:
        return False
    a, b = (between(np.broadcast_to(p[both[0]], (len(both), 3)), p[both]) for p in (one, other))
    return bool(np.abs(a).max() > 0.1 and np.abs(a - b).max() < SAME)
