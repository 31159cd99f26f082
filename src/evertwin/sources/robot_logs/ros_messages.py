"""Messages as flat rows of numbers: ``pose.pose.position.x``, ``twist.twist.angular.z``, ….

Every numeric leaf of a message becomes a column. A quaternion also gives its ``yaw`` about the
vertical axis. The entries of a joint state are named by their joints, those of ``/tf`` by the frame
that each places. Covariances and long arrays (scans, images) are no columns. A message with a
header is stamped by it (``/tf`` by its first transform), else by its logging time.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.foreign import Damaged, foreign, load
from evertwin.sources.robot_logs.bag_files import Connection, Message

WIDEST = 16
"""Entries of the longest array that becomes columns."""
_ARRAYS = (list, tuple, np.ndarray)
DEEPEST = 16
"""Messages within messages that are looked into."""


class Content(NamedTuple):
    """What a message says: its numbers by name, and its own stamp [ns].

    >>> Content({"data": 1.5}, None).cells
    {'data': 1.5}
    """

    cells: Mapping[str, float]
    stamp: int | None


class Decoder:
    """Bytes of a message → its numbers and its stamp.

    >>> Decoder().read(Message(Connection("/v", "", "json", ""), 5, b'{"data": 1.5}'))
    Content(cells={'data': 1.5}, stamp=None)
    """

    def __init__(self) -> None:
        self._own: dict[str, Any] = {}
        self._known: dict[tuple[str, str], Any] = {}
        self._plans: dict[type, _Plan | None] = {}

    def read(self, message: Message) -> Content:
        """The numbers and the stamp of a message.

        Raises:
            DataError: an encoding or a type that is not known, or damaged bytes.
        """
        content = self.content(message)
        kind = type(content)
        if kind not in self._plans:
            self._plans[kind] = _Plan.of(content) if _fixed(content) else None
        plan = self._plans[kind]
        return Content(dict(flat(content)), stamp_of(content)) if plan is None else plan(content)

    def content(self, message: Message) -> Any:
        """A message decoded and nothing more.

        Raises:
            DataError: as `read`.
        """
        try:
            with foreign(message.connection.topic):
                return self._decoded(message)
        except Damaged as error:
            kind = message.connection.type or message.connection.encoding
            raise DataError(f"damaged message of type {kind!r} ({error.reason})") from None

    def _decoded(self, message: Message) -> Any:
        connection = message.connection
        if connection.encoding == "json":
            content = json.loads(message.data)
            if not isinstance(content, dict):
                raise DataError(f"expected a JSON object, got {type(content).__name__}")
            return content
        if connection.encoding not in ("cdr", "ros1"):
            raise DataError(
                f"encoding {connection.encoding or 'none'!r}: expected cdr, ros1 or json"
            )
        store, name = self._store(connection), _full(connection.type)
        if name not in store.fielddefs:
            raise DataError(
                f"type {connection.type!r} is not known and the bag carries no definition of it"
            )
        decode = store.deserialize_cdr if connection.encoding == "cdr" else store.deserialize_ros1
        return decode(message.data, name)

    def _store(self, connection: Connection) -> Any:
        """The standard types, or a store of this decoder's own where the bag defines more."""
        key = (connection.encoding, connection.type)
        if key not in self._known:
            store = _standard(connection.encoding)
            own = connection.definition.strip() and _full(connection.type) not in store.fielddefs
            self._known[key] = self._extended(connection) if own else store
        return self._known[key]

    def _extended(self, connection: Connection) -> Any:
        typesys = load("rosbags.typesys")
        kind = connection.encoding
        store = self._own.setdefault(kind, _standard.__wrapped__(kind))
        try:
            with foreign(connection.topic):
                types = typesys.get_types_from_msg(connection.definition, _full(connection.type))
                store.register({k: v for k, v in types.items() if k not in store.fielddefs})
        except Damaged as error:
            raise DataError(f"definition of {connection.type!r}: {error.reason}") from None
        return store


@cache
def _standard(encoding: str) -> Any:
    """The standard message types of ROS 1 or ROS 2."""
    typesys = load("rosbags.typesys")
    which = typesys.Stores.ROS1_NOETIC if encoding == "ros1" else typesys.Stores.ROS2_HUMBLE
    return typesys.get_typestore(which)


def _full(type_: str) -> str:
    """``nav_msgs/Odometry`` (ROS 1) as ``nav_msgs/msg/Odometry``."""
    parts = type_.split("/")
    return "/".join([parts[0], "msg", *parts[1:]]) if len(parts) == 2 else type_


def _members(value: Any) -> list[tuple[str, Any]] | None:
    if isinstance(value, Mapping):
        return [(str(k), v) for k, v in value.items()]
    if not hasattr(value, "__dataclass_fields__"):
        return None
    kind: Any = type(value)
    return [(k, getattr(value, k)) for k in _fields(kind)]


@cache
def _fields(kind: Any) -> tuple[str, ...]:
    """Of a decoded type; its constants (OK, WARN) are none."""
    return tuple(
        f.name for f in dataclasses.fields(kind)
        if not f.name.startswith("__") and not str(f.type).startswith("ClassVar")
    )  # fmt: skip


def _fixed(content: Any) -> bool:
    """Does its type alone tell which numbers it has, for no array is one?"""
    return hasattr(content, "__dataclass_fields__") and all(
        name == "header" or "covariance" in name or _fixed(value)
        or isinstance(value, str | bool | int | float | np.number)
        for name, value in _members(content) or ()
    )  # fmt: skip


class _Plan(NamedTuple):
    """Where the numbers of a type are, found once: what `flat` and `stamp_of` tell of a message."""

    names: tuple[str, ...]
    own: tuple[str, ...]
    """Those that are members, not yaws of quaternions."""
    members: Callable[[Any], tuple[Any, ...]]

    @classmethod
    def of(cls, content: Any) -> _Plan:
        names = tuple(name for name, _ in flat(content))
        turns = {
            name for name in names if name.rpartition(".")[2] == "yaw" and not _has(content, name)
        }
        own = tuple(name for name in names if name not in turns)
        return cls(names, own, attrgetter(*own, own[0]) if own else lambda _: ())

    def __call__(self, content: Any) -> Content:
        cells = dict(zip(self.own, map(float, self.members(content)), strict=False))
        if len(self.own) < len(self.names):
            cells = {n: cells[n] if n in cells else _yaw(cells, n) for n in self.names}
        return Content(cells, stamp_of(content))


def _has(content: Any, path: str) -> bool:
    for name in path.split("."):
        content = getattr(content, name, None)
    return content is not None


def _yaw(cells: Mapping[str, float], name: str) -> float:
    """About the vertical axis [rad], of the quaternion beside."""
    prefix = name.removesuffix("yaw")
    x, y, z, w = (cells.get(f"{prefix}{axis}", 0.0) for axis in "xyzw")
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _numbers(values: Any) -> list[float]:
    """Numbers as float64; empty where one is something else."""
    out = []
    for value in values:
        if not isinstance(value, bool | int | float | np.number | np.bool_):
            return []
        try:
            out.append(float(value))
        except OverflowError:  # a whole number with more digits than any double
            out.append(math.inf)
    return out


def flat(message: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """The numeric leaves of a decoded message, in its own order.

    >>> dict(flat({"p": {"x": 1, "on": True}, "name": ["a", "b"], "position": [0.5, 0.7]}))
    {'p.x': 1.0, 'p.on': 1.0, 'position.a': 0.5, 'position.b': 0.7}
    """
    members = dict(_members(message) or [])
    named = members.get("name")
    names = [n for n in named if isinstance(n, str)] if isinstance(named, _ARRAYS) else []
    for name, value in members.items():
        path = f"{prefix}{name}"
        if name == "header" or "covariance" in name or depth > DEEPEST:
            continue
        if _members(value) is not None:
            yield from flat(value, f"{path}.", depth + 1)
        elif isinstance(value, _ARRAYS):
            yield from _array(path, value, names, depth) if len(value) <= WIDEST else ()
        else:
            yield from ((path, number) for number in _numbers([value]))
    flat_turn = members.keys() == {"z", "w"}  # JSON may leave zeros out
    turn = _numbers(members.get(axis, 0.0 if flat_turn else None) for axis in "xyzw")
    if turn:
        yield f"{prefix}yaw", _yaw(dict(zip("xyzw", turn, strict=True)), "yaw")


def _array(path: str, value: Any, names: list[str], depth: int) -> Iterator[tuple[str, float]]:
    labels = names if len(names) == len(value) else _frames(value)
    numbers = _numbers(value)
    if numbers:
        yield from ((f"{path}.{n}", v) for n, v in zip(labels, numbers, strict=True))
        return
    for label, item in zip(labels, value, strict=True):
        if _members(item) is not None:
            yield from flat(item, f"{path}.{label}.", depth + 1)


def _frames(value: Any) -> list[str]:
    """Names of an array's entries: the frames that transforms place, else their numbers."""
    framed = [dict(_members(one) or []).get("child_frame_id") for one in value]
    found = [one.lstrip("/") for one in framed if isinstance(one, str) and one]
    whole = len(found) == len(value) == len(set(found))
    return found if whole else [str(i + 1) for i in range(len(value))]


def array_of(message: Any, path: str) -> list[float] | None:
    """The numbers of an array, however long; None where the message has no such array.

    >>> array_of({"scan": {"ranges": [1, 2.5]}}, "scan.ranges"), array_of({"scan": 1}, "scan")
    ([1.0, 2.5], None)
    """
    for key in path.split("."):
        message = dict(_members(message) or []).get(key)
    return _numbers(message) if isinstance(message, _ARRAYS) else None


def stamp_of(message: Any) -> int | None:
    """The stamp of the message's own header [ns], None without one or with a zero one."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is not None:
        return stamp.sec * 10**9 + stamp.nanosec or None
    members = dict(_members(message) or [])
    transforms = members.get("transforms")
    if isinstance(transforms, _ARRAYS) and len(transforms):
        members = dict(_members(transforms[0]) or [])
    header = members.get("header")
    stamp = dict(_members(header) or []).get("stamp") if header is not None else None
    parts = dict(_members(stamp) or []) if stamp is not None else {}
    seconds = parts.get("sec", parts.get("secs"))
    nanos = parts.get("nanosec", parts.get("nsec", parts.get("nsecs")))
    if not (isinstance(seconds, int | np.integer) and isinstance(nanos, int | np.integer)):
        return None
    total = int(seconds) * 10**9 + int(nanos)
    return total or None
