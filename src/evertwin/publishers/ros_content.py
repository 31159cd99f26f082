"""What the ROS publisher says, as the fields of ROS messages.

>>> stamp(1_500_000_000)
{'secs': 1, 'nsecs': 500000000}
>>> pose((1.0, 2.0, 0.0))["position"]
{'x': 1.0, 'y': 2.0}
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

from evertwin.ros.transforms import Pose

Content: TypeAlias = dict[str, Any]
OK, WARN, ERROR, STALE = range(4)
"""Levels of a diagnostic status."""
LEVELS = {"good": OK, "failure": ERROR}
"""By condition; all others are warnings."""
ARROW, CYLINDER, LINES, SPHERES = 0, 3, 5, 7
"""Kinds of markers."""
GHOST = {"r": 0.3, "g": 0.6, "b": 1.0, "a": 0.5}
JUMP = {"r": 1.0, "g": 0.3, "b": 0.8, "a": 1.0}
TALL = 0.5
"""Height of the ghost, as a share of its diameter."""


def stamp(t: int) -> Content:
    """A time [ns]."""
    return {"secs": t // 10**9, "nsecs": t % 10**9}


def header(t: int, frame: str) -> Content:
    """When and where; the number is counted where it is sent."""
    return {"stamp": stamp(t), "frame_id": frame}


def turned(heading: float) -> Content:
    """A heading as a quaternion."""
    return {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}


def pose(at: Pose) -> Content:
    """A pose in the plane."""
    return {"position": {"x": at[0], "y": at[1]}, "orientation": turned(at[2])}


def odometry(head: Content, child: str, at: Pose, moves: Pose, sigma: Pose) -> Content:
    """``nav_msgs/Odometry``. ``moves``: speed ahead, to the left, turning; ``sigma``: standard
    deviations of the pose. What is not known of them is a covariance of −1."""
    spread = [0.0] * 36
    for k, one in zip((0, 7, 35), sigma, strict=True):
        spread[k] = one * one if math.isfinite(one) else -1.0
    known = [one if math.isfinite(one) else 0.0 for one in moves]
    twist = {"linear": {"x": known[0], "y": known[1]}, "angular": {"z": known[2]}}
    return {
        "header": head, "child_frame_id": child,
        "pose": {"pose": pose(at), "covariance": spread},
        "twist": {"twist": twist, "covariance": [-1.0] + [0.0] * 35},
    }  # fmt: skip


def path(head: Content, poses: Iterable[tuple[int, Pose]]) -> Content:
    """``nav_msgs/Path``."""
    frame = head["frame_id"]
    return {
        "header": head,
        "poses": [{"header": header(t, frame), "pose": pose(p)} for t, p in poses],
    }


def placed(parent: str, child: str, t: int, at: Pose) -> Content:
    """``tf2_msgs/TFMessage`` with one transform."""
    translation = {"x": at[0], "y": at[1]}
    transform = {"translation": translation, "rotation": turned(at[2])}
    head = header(t, parent)
    return {"transforms": [{"header": head, "child_frame_id": child, "transform": transform}]}


def ghost(head: Content, at: Pose, size: float) -> Content:
    """``visualization_msgs/MarkerArray``: where the simulated machine is, and where it heads."""
    body = pose(at)
    body["position"]["z"] = TALL * size / 2
    nose = pose(at)
    nose["position"]["z"] = TALL * size
    return {"markers": [
        {"header": head, "ns": "ghost", "id": 0, "type": CYLINDER, "pose": body, "color": GHOST,
         "scale": {"x": size, "y": size, "z": TALL * size}},
        {"header": head, "ns": "ghost", "id": 1, "type": ARROW, "pose": nose,
         "color": {**GHOST, "a": 0.9},
         "scale": {"x": 0.9 * size, "y": 0.12 * size, "z": 0.12 * size}},
    ]}  # fmt: skip


def updates(head: Content, jumps: Iterable[tuple[Pose, Pose]], size: float) -> Content:
    """``visualization_msgs/MarkerArray``: where the simulation adopted what was measured, and from
    where it came."""
    points = [[{"x": p[0], "y": p[1], "z": 0.01} for p in one] for one in jumps]
    still = {"orientation": {"w": 1.0}}
    wide, thin = 0.3 * size, 0.08 * size
    return {"markers": [
        {"header": head, "ns": "updates", "id": 0, "type": SPHERES, "pose": still, "color": JUMP,
         "scale": {"x": wide, "y": wide, "z": wide}, "points": [to for _, to in points]},
        {"header": head, "ns": "updates", "id": 1, "type": LINES, "pose": still, "color": JUMP,
         "scale": {"x": thin}, "points": [point for one in points for point in one]},
    ]}  # fmt: skip


def status(name: str, level: int, message: str, values: Mapping[str, object]) -> Content:
    """``diagnostic_msgs/DiagnosticStatus``."""
    told = [{"key": key, "value": _said(value)} for key, value in values.items()]
    return {"name": name, "hardware_id": name.partition(":")[0], "level": level,
            "message": message, "values": told}  # fmt: skip


def _said(value: object) -> str:
    if value is None:
        return "not known"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def joints(head: Content, names: Sequence[str], values: Mapping[str, Sequence[float]]) -> Content:
    """``sensor_msgs/JointState``: position, velocity, effort, as far as they are known."""
    return {"header": head, "name": list(names), **{key: list(v) for key, v in values.items()}}
