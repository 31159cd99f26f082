"""What moves a machine, from the messages of a bag: poses, turn rates, and the tree of ``/tf``.

A quaternion becomes a matrix, so that a lidar that hangs upside down or a tilted gyro is told from
one that stands.

>>> turn = rotation({"x": 0.0, "y": 0.0, "z": 1.0, "w": 1.0})
>>> float(heading(turn)).__round__(3), (turn @ [1.0, 0.0, 0.0]).round(3).tolist()
(1.571, [0.0, 1.0, 0.0])
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from evertwin.sources.columns.scans import Track
from evertwin.sources.robot_logs.ros_messages import stamp_of
from evertwin.types import Float64, Stamps

REFERENCES = ("map", "world", "earth", "utm", "truth", "mocap", "vicon", "optitrack", "gps", "slam",
              "amcl")  # fmt: skip
"""Parts of the names of frames and topics that no wheels speak on."""
STRANGE = 60 * 10**9
"""A stamp that is off the time of logging by so much more than usual is wrong [ns]."""
OTHER = 10**9
"""Clocks that differ by more are two [ns]."""

Matrix = Float64[np.ndarray, "3 3"]


def part(content: Any, path: str) -> Any:
    """A member of a decoded message, by its path; None where there is none.

    >>> part({"pose": {"x": 1.0}}, "pose.x"), part({}, "pose.x")
    (1.0, None)
    """
    for key in path.split("."):
        content = content.get(key) if isinstance(content, dict) else getattr(content, key, None)
    return content


def number(content: Any, path: str) -> float:
    """The same as a number; NaN where there is none."""
    value = part(content, path)
    return float(value) if isinstance(value, int | float | np.number) else math.nan


def rotation(quaternion: Any) -> Matrix:
    """Of x, y, z, w, of whatever length; NaN where it has none."""
    x, y, z, w = (number(quaternion, axis) for axis in "xyzw")
    if isinstance(quaternion, dict):  # in JSON zeros may be left out
        x, y, z, w = (0.0 if math.isnan(v) and k not in quaternion else v
                      for k, v in zip("xyzw", (x, y, z, w), strict=True))  # fmt: skip
    length = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = (v / length if length > 0 else math.nan for v in (x, y, z, w))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def heading(turn: Matrix) -> float:
    """Where its x axis looks in the plane [rad]."""
    return math.atan2(turn[1, 0], turn[0, 0])


def _vector(content: Any) -> Float64[np.ndarray, " 3"]:
    """x, y, z; what is not there is 0, what is no number NaN."""
    known = (axis if part(content, axis) is not None else "" for axis in "xyz")
    return np.array([number(content, axis) if axis else 0.0 for axis in known])


class Stamped(NamedTuple):
    """Numbers of a message: its own stamp, the time of logging [ns], values.

    >>> Stamped(5, 7, (1.0,)).logged
    7
    """

    own: int | None
    logged: int
    values: tuple[float, ...]


class Link(NamedTuple):
    """Where a frame is in its parent.

    >>> Link("base_link", np.eye(3), np.zeros(3)).parent
    'base_link'
    """

    parent: str
    turn: Matrix
    place: Float64[np.ndarray, " 3"]


@dataclass
class Frames:
    """The tree of ``/tf``.

    >>> Frames().on("laser", "base") is None
    True
    """

    links: dict[str, Link] = field(default_factory=dict)
    """The first of each frame."""
    wheels: dict[str, list[Stamped]] = field(default_factory=dict)
    """Poses of frames whose parent is a frame of wheels."""

    def take(self, content: Any, logged: int) -> None:
        """The transforms of one message."""
        for one in part(content, "transforms") or ():
            parent, child = (
                str(part(one, name) or "").lstrip("/")
                for name in ("header.frame_id", "child_frame_id")
            )
            turn = rotation(part(one, "transform.rotation"))
            place = np.nan_to_num(_vector(part(one, "transform.translation")))
            self.links.setdefault(child, Link(parent, turn, place))
            if "odom" in parent:
                values = (float(place[0]), float(place[1]), heading(turn))
                self.wheels.setdefault(child, []).append(Stamped(stamp_of(one), logged, values))

    def on(self, frame: str, base: str) -> Link | None:
        """Where ``frame`` is on the machine: on ``base``, or on the last frame below one of wheels
        or of a map; None where the tree does not hold it."""
        turn, place, at = np.eye(3), np.zeros(3), frame.lstrip("/")
        known = at == base
        for _ in self.links:
            link = self.links.get(at)
            if at == base or link is None or _global(link.parent) or "odom" in link.parent:
                break
            turn, place, at = link.turn @ turn, link.turn @ place + link.place, link.parent
            known = True
        reached = at == base or base not in self.links
        return Link(at, turn, place) if known and reached else None


def _global(name: str) -> bool:
    return any(word in name.lower() for word in REFERENCES)


@dataclass
class Moved:
    """Poses or turn rates of one topic.

    >>> Moved("/odom").rows
    []
    """

    name: str
    frame: str = ""
    child: str = ""
    rows: list[Stamped] = field(default_factory=list)

    @property
    def reference(self) -> bool:
        """Does it tell poses in a map, as no wheels do?"""
        return _global(self.frame) or _global(self.name)


def pose_of(content: Any) -> tuple[float, float, float]:
    """x, y [m] and heading [rad] of a `Pose`, `PoseWithCovariance` or what holds one."""
    while part(content, "pose") is not None:
        content = part(content, "pose")
    place = part(content, "position")
    turn = heading(rotation(part(content, "orientation")))
    x, y = _vector(place)[:2]
    return float(x), float(y), turn


def rate_of(content: Any) -> tuple[float, ...]:
    """Turn rates of an `Imu` about its axes [rad/s]."""
    return tuple(_vector(part(content, "angular_velocity")).tolist())


class Clocked(NamedTuple):
    """Times of messages by their sender's clock.

    >>> clocked([Stamped(10, 12, ()), Stamped(None, 22, ())]).t.tolist()
    [10, 20]
    """

    t: Stamps
    arrived: Stamps
    offset: int
    """Of the sender's clock against that of logging, median [ns]."""
    mended: int
    """Stamps that were absent or wrong, told from the times of logging."""


def clocked(rows: list[Stamped]) -> Clocked:
    """Own stamps; what has none, or one that cannot be, is placed by its logging."""
    logged = np.array([row.logged for row in rows], dtype=np.int64)
    known = np.array([row.own is not None or row.logged == 0 for row in rows])  # 0: a clock's start
    own = np.array([row.own or 0 for row in rows], dtype=np.int64)
    offset = int(np.median((own - logged)[known])) if known.any() else 0
    strange = ~known | (np.abs(own - logged - offset) > STRANGE)
    arrived = logged if abs(offset) < OTHER else logged + offset
    return Clocked(np.where(strange, logged + offset, own), arrived, offset, int(strange.sum()))


def track(moved: Moved, offset: int) -> Track | None:
    """What a topic told, in the order of its stamps, on the clock that is off by ``offset``."""
    clock = clocked(moved.rows)
    other = abs(clock.offset - offset) > OTHER
    shift = offset - clock.offset if other else 0
    values = np.array([row.values for row in moved.rows])
    t, kept = np.unique(clock.t + shift, return_index=True)
    whole = np.isfinite(values[kept]).all(axis=1)
    if whole.sum() < 2:
        return None
    arrived = (clock.arrived + shift)[kept]
    return Track(moved.name, t[whole], arrived[whole], values[kept][whole])
