"""Transforms of ``/tf`` in the plane: read from the bytes of a message, kept for a while, asked for
at a time.

A pose in the plane is x, y [m] and heading [rad]; `beyond` and `within` are the group SE(2).

>>> [round(v, 3) for v in beyond((1.0, 0.0, math.pi / 2), (2.0, 0.0, 0.0))]
[1.0, 2.0, 1.571]
>>> [round(v, 3) for v in within((1.0, 0.0, math.pi / 2), (1.0, 2.0, math.pi / 2))]
[2.0, 0.0, 0.0]
"""

from __future__ import annotations

import math
import struct
from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

Pose: TypeAlias = tuple[float, float, float]
TYPES = ("tf2_msgs/TFMessage", "tf/tfMessage")
KEPT = 2000
"""Transforms of a frame that are remembered."""
OLD = 30.0
"""Seconds that they are."""


class Transform(NamedTuple):
    """Where a frame is in its parent.

    >>> Transform("odom", "base_link", 0, (0.0, 0.0, 0.0)).child
    'base_link'
    """

    parent: str
    child: str
    t: int
    """Its stamp [ns]."""
    pose: Pose


def beyond(one: Pose, other: Pose) -> Pose:
    """``other``, given in the frame that ``one`` places, in the frame that ``one`` is given in."""
    c, s = math.cos(one[2]), math.sin(one[2])
    x, y = one[0] + c * other[0] - s * other[1], one[1] + s * other[0] + c * other[1]
    return x, y, wrapped(one[2] + other[2])


def within(one: Pose, other: Pose) -> Pose:
    """``other`` as seen from ``one``, both given in one frame."""
    c, s = math.cos(one[2]), math.sin(one[2])
    dx, dy = other[0] - one[0], other[1] - one[1]
    return c * dx + s * dy, c * dy - s * dx, wrapped(other[2] - one[2])


def wrapped(angle: float) -> float:
    """In −π … π."""
    return math.remainder(angle, math.tau)


def yaw(x: float, y: float, z: float, w: float) -> float:
    """Turn about the vertical axis of a quaternion."""
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def transforms(data: bytes) -> list[Transform]:
    """Those of a message of one of `TYPES`, in ROS 1's form.

    Raises:
        ValueError: the bytes are of something else.
    """
    try:
        (count,), at = struct.unpack_from("<I", data), 4
        found = []
        for _ in range(count):
            _, secs, nsecs = struct.unpack_from("<3I", data, at)
            parent, at = _text(data, at + 12)
            child, at = _text(data, at)
            x, y, _, *turn = struct.unpack_from("<7d", data, at)
            at += 56
            pose = (x, y, yaw(*turn))
            found.append(Transform(parent, child, secs * 10**9 + nsecs, pose))
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"no message of transforms: {error}") from None
    if at != len(data):
        raise ValueError(f"no message of transforms: {len(data) - at} bytes are left")
    return found


def _text(data: bytes, at: int) -> tuple[str, int]:
    (size,) = struct.unpack_from("<I", data, at)
    end = at + 4 + size
    if end > len(data):
        raise struct.error("a text that does not end")
    return data[at + 4 : end].decode().lstrip("/"), end


class Past:
    """Where a frame was in its parent, for the last `OLD` seconds.

    >>> past = Past()
    >>> past.add(0, (0.0, 0.0, 0.0)); past.add(10**9, (1.0, 0.0, 0.5))
    >>> past.at(5 * 10**8), past.at(2 * 10**9)
    ((0.5, 0.0, 0.25), None)
    """

    def __init__(self) -> None:
        self._kept: deque[tuple[int, Pose]] = deque(maxlen=KEPT)

    def add(self, t: int, pose: Pose) -> None:
        """One more; a stamp that goes back begins anew."""
        if self._kept and t <= self._kept[-1][0]:
            if t == self._kept[-1][0]:
                return
            self._kept.clear()
        self._kept.append((t, pose))
        while self._kept[0][0] < t - OLD * 1e9:
            self._kept.popleft()

    def at(self, t: int) -> Pose | None:
        """In between the two neighbours of a time [ns]; None where it is not known."""
        stamps: Sequence[int] = [one[0] for one in self._kept]
        k = bisect_left(stamps, t)
        if k == len(stamps) or (k == 0 and stamps[0] != t):
            return None
        later, after = self._kept[k]
        if later == t:
            return after
        earlier, before = self._kept[k - 1]
        share = (t - earlier) / (later - earlier)
        x, y, turn = within(before, after)
        return beyond(before, (share * x, share * y, share * turn))
