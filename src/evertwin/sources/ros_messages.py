"""Messages as flat rows of numbers: ``pose.pose.position.x``, ``twist.twist.angular.z``, ….

Every numeric leaf of a message becomes a column. A quaternion also gives its ``yaw`` about the
vertical axis. The entries of a joint state are named by their joints. Covariances and long arrays
(scans, images) are no columns. A message with a header is stamped by it, else by its logging time.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.bag_files import Connection, Message
from evertwin.sources.optional import load

__all__ = ["Decoder", "flat", "stamp_of"]

WIDEST = 16
"""Entries of the longest array that becomes columns."""


class Decoder:
    """Bytes of a message → an object or a dictionary.

    >>> Decoder().decode(Message(Connection("/v", "", "json", ""), 5, b'{"data": 1.5}'))
    {'data': 1.5}
    """

    def __init__(self) -> None:
        self._own: dict[str, Any] = {}
        self._known: dict[tuple[str, str], Any] = {}

    def decode(self, message: Message) -> Any:
        """The message.

        Raises:
            DataError: an encoding or a type that is not known, or damaged bytes.
        """
        connection = message.connection
        if connection.encoding == "json":
            return _json(message.data)
        if connection.encoding not in ("cdr", "ros1"):
            raise DataError(
                f"encoding {connection.encoding or 'none'!r}: expected cdr, ros1 or json"
            )
        store = self._store(connection)
        name = _full(connection.type)
        decode = store.deserialize_cdr if connection.encoding == "cdr" else store.deserialize_ros1
        try:
            return decode(message.data, name)
        except KeyError:
            raise DataError(
                f"type {connection.type!r} is not known and the bag carries no definition of it"
            ) from None
        except _serde_errors() as error:
            raise DataError(f"damaged message of type {connection.type!r} ({error})") from None

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
            types = typesys.get_types_from_msg(connection.definition, _full(connection.type))
            store.register({k: v for k, v in types.items() if k not in store.fielddefs})
        except (typesys.TypesysError, ValueError, KeyError, TypeError, AssertionError) as error:
            raise DataError(f"definition of {connection.type!r}: {error}") from None
        return store


@cache
def _standard(encoding: str) -> Any:
    """The standard message types of ROS 1 or ROS 2."""
    typesys = load("rosbags.typesys")
    which = typesys.Stores.ROS1_NOETIC if encoding == "ros1" else typesys.Stores.ROS2_HUMBLE
    return typesys.get_typestore(which)


def _serde_errors() -> tuple[type[Exception], ...]:
    serde: type[Exception] = load("rosbags.serde").SerdeError
    return (ValueError, IndexError, AssertionError, TypeError, OverflowError, MemoryError,
            struct.error, serde)  # fmt: skip


def _json(data: bytes) -> Any:
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise DataError(f"damaged JSON ({error})") from None
    if not isinstance(content, dict):
        raise DataError(f"expected a JSON object, got {type(content).__name__}")
    return content


def _full(type_: str) -> str:
    """``nav_msgs/Odometry`` (ROS 1) as ``nav_msgs/msg/Odometry``."""
    parts = type_.split("/")
    return "/".join([parts[0], "msg", *parts[1:]]) if len(parts) == 2 else type_


def _members(value: Any) -> list[tuple[str, Any]] | None:
    if isinstance(value, Mapping):
        return [(str(k), v) for k, v in value.items()]
    fields = getattr(value, "__dataclass_fields__", None)
    if fields is None:
        return None
    return [(k, getattr(value, k)) for k in fields if not k.startswith("__")]


def flat(message: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    """The numeric leaves of a decoded message, in its own order.

    >>> dict(flat({"p": {"x": 1, "on": True}, "name": ["a", "b"], "position": [0.5, 0.7]}))
    {'p.x': 1.0, 'p.on': 1.0, 'position.a': 0.5, 'position.b': 0.7}
    """
    members = _members(message) or []
    names = [str(n) for n in dict(members).get("name", ()) if isinstance(n, str)]
    fields = {name for name, _ in members}
    for name, value in members:
        path = f"{prefix}{name}"
        if name == "header" or "covariance" in name:
            continue
        if isinstance(value, bool | int | float | np.number | np.bool_):
            yield path, float(value)
        elif isinstance(value, str | bytes) or value is None:
            continue
        elif _members(value) is not None:
            yield from flat(value, f"{path}.")
        elif isinstance(value, np.ndarray | list | tuple) and len(value) <= WIDEST:
            yield from _array(path, value, names)
    if {"x", "y", "z", "w"} <= fields:
        x, y, z, w = (float(dict(members)[axis]) for axis in "xyzw")
        yield f"{prefix}yaw", math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _array(path: str, value: Any, names: list[str]) -> Iterator[tuple[str, float]]:
    numeric = all(isinstance(v, bool | int | float | np.number | np.bool_) for v in value)
    labels = names if len(names) == len(value) else [str(i + 1) for i in range(len(value))]
    for label, item in zip(labels, value, strict=True):
        if numeric:
            yield f"{path}.{label}", float(item)
        elif _members(item) is not None:
            yield from flat(item, f"{path}.{label}.")


def stamp_of(message: Any) -> int | None:
    """The stamp of the message's own header [ns], None without one or with a zero one."""
    header = dict(_members(message) or []).get("header")
    stamp = dict(_members(header) or []).get("stamp") if header is not None else None
    parts = dict(_members(stamp) or []) if stamp is not None else {}
    seconds = parts.get("sec", parts.get("secs"))
    nanos = parts.get("nanosec", parts.get("nsec", parts.get("nsecs")))
    if seconds is None or nanos is None:
        return None
    total = int(seconds) * 10**9 + int(nanos)
    return total or None
