"""Poses in the plane: x, y [m] and heading [rad], and the steps between them.

A step is told in the frame of the pose that it starts from, so it does not depend on the map.

>>> step = between(np.array([1.0, 2.0, np.pi / 2]), np.array([1.0, 3.0, np.pi]))
>>> (step + 0).round(3).tolist()
[1.0, 0.0, 1.571]
>>> compose(np.array([1.0, 2.0, np.pi / 2]), step).round(3).tolist()
[1.0, 3.0, 3.142]
"""

from __future__ import annotations

import numpy as np

from evertwin.types import Float64

Pose = Float64[np.ndarray, "*n 3"]


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Into [-π, π) [rad].

    >>> wrapped(np.array([4.0, -1.0])).round(3).tolist()
    [-2.283, -1.0]
    """
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def compose(pose: Pose, step: Pose) -> Pose:
    """``pose``, and from there ``step``; arrays of the same shape (…, 3)."""
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x = pose[..., 0] + c * step[..., 0] - s * step[..., 1]
    y = pose[..., 1] + s * step[..., 0] + c * step[..., 1]
    return np.stack([x, y, pose[..., 2] + step[..., 2]], axis=-1)


def between(start: Pose, end: Pose) -> Pose:
    """The step from ``start`` to ``end``, its turn in [-π, π); arrays of the same shape (…, 3)."""
    d = end - start
    c, s = np.cos(start[..., 2]), np.sin(start[..., 2])
    x, y = c * d[..., 0] + s * d[..., 1], c * d[..., 1] - s * d[..., 0]
    return np.stack([x, y, wrapped(d[..., 2])], axis=-1)


def chained(start: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Poses (n + 1, 3) that follow from ``start`` by each of ``steps`` (n, 3).

    >>> chained(np.zeros(3), np.array([[1.0, 0.0, np.pi / 2]] * 3))[-1].round(3).tolist()
    [0.0, 1.0, 4.712]
    """
    heading = start[2] + np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
    x = start[0] + np.cumsum(c * steps[:, 0] - s * steps[:, 1])
    y = start[1] + np.cumsum(s * steps[:, 0] + c * steps[:, 1])
    way = np.concatenate([start[None, :2], np.column_stack([x, y])])
    return np.column_stack([way, heading])
