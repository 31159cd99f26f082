"""Where the tool of a serial arm is, and which joint angles bring it somewhere.

Forward kinematics and the tool's Jacobian from the geometry that the dynamics use; the inverse by
damped least squares, point after point along a path, each starting at the one before.

Damped least squares: Wampler (1986), Nakamura and Hanafusa (1986).
"""

from __future__ import annotations

import numpy as np

from evertwin.errors import UsageError
from evertwin.machines.arm.chain import Chain
from evertwin.machines.arm.rnea import JOINT
from evertwin.types import Float64, Vector

ROUNDS = 60
"""Most corrections a point."""
CLOSE = 1e-9
"""Position error [m] and rotation error [rad] at which a point is reached."""


def frames(chain: Chain, q: Float64[np.ndarray, "n joints"]) -> list[Float64[np.ndarray, "n 4 4"]]:
    """The frame of each joint in the base, behind its motion, at many joint positions [rad, m]."""
    frame, found = np.broadcast_to(np.eye(4), (len(q), 4, 4)), []
    for j in range(chain.n):
        numbers = chain.geometry[3 + JOINT * j : 3 + JOINT * (j + 1)]
        here, move = np.eye(4), np.broadcast_to(np.eye(4), (len(q), 4, 4)).copy()
        here[:3, :3], here[:3, 3] = numbers[:9].reshape(3, 3), numbers[9:12]
        if chain.sliding[j]:
            move[:, 2, 3] = q[:, j]
        else:
            c, s = np.cos(q[:, j]), np.sin(q[:, j])
            move[:, 0, 0], move[:, 0, 1], move[:, 1, 0], move[:, 1, 1] = c, -s, s, c
        frame = frame @ here @ move
        found.append(frame)
    return found


def tool(
    chain: Chain, q: Vector
) -> tuple[Float64[np.ndarray, "4 4"], Float64[np.ndarray, "6 joints"]]:
    """The tool's frame in the base, and its Jacobian (linear velocity first), at ``q`` [rad, m].

    >>> from evertwin.machines.arm.chain import serial
    >>> from evertwin.machines.arm.model import robot
    >>> frame, jacobian = tool(serial(robot("ur5_like")), np.zeros(6))
    >>> frame.shape, jacobian.shape
    ((4, 4), (6, 6))
    """
    joints = [frame[0] for frame in frames(chain, q[None])]
    frame, jacobian = joints[-1] @ chain.tool, np.zeros((6, chain.n))
    for j, joint in enumerate(joints):
        axis = joint[:3, 2]
        if chain.sliding[j]:
            jacobian[:3, j] = axis
        else:
            jacobian[:3, j] = np.cross(axis, frame[:3, 3] - joint[:3, 3])
            jacobian[3:, j] = axis
    return frame, jacobian


def tips(chain: Chain, q: Float64[np.ndarray, "n joints"]) -> Float64[np.ndarray, "n 3"]:
    """Where the tool is [m] at each of many joint positions [rad, m].

    >>> from evertwin.machines.arm.chain import serial
    >>> from evertwin.machines.arm.model import robot
    >>> chain, q = serial(robot("ur5_like")), np.linspace(0.0, 1.0, 12).reshape(2, 6)
    >>> bool(np.allclose(tips(chain, q)[1], tool(chain, q[1])[0][:3, 3]))
    True
    """
    found: Float64[np.ndarray, "n 3"] = (frames(chain, q)[-1] @ chain.tool)[:, :3, 3]
    return found


def _rotation(matrix: Float64[np.ndarray, "3 3"]) -> Vector:
    """Rotation vector of a rotation by less than half a turn [rad]."""
    vector = 0.5 * np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    sine, cosine = float(np.linalg.norm(vector)), 0.5 * (float(np.trace(matrix)) - 1.0)
    return vector if sine < 1e-12 else np.asarray(vector * np.arctan2(sine, cosine) / sine)


def follow(
    chain: Chain,
    start: Vector,
    places: Float64[np.ndarray, "n 3"],
    turn: Float64[np.ndarray, "3 3"],
) -> Float64[np.ndarray, "n joints"]:
    """Joint positions that put the tool at ``places`` [m] with orientation ``turn``.

    Args:
        start: joint positions near the first place.

    Raises:
        UsageError: a place cannot be reached; it is named.
    """
    q, found = np.array(start, dtype=np.float64), np.empty((len(places), chain.n))
    for i, place in enumerate(places):
        for _ in range(ROUNDS):
            frame, jacobian = tool(chain, q)
            error = np.r_[place - frame[:3, 3], _rotation(turn @ frame[:3, :3].T)]
            if np.linalg.norm(error) < CLOSE:
                break
            damped = jacobian @ jacobian.T + 1e-10 * np.eye(6)
            q = q + jacobian.T @ np.linalg.solve(damped, error)
        else:
            raise UsageError(
                f"path: the tool cannot reach {place.round(4).tolist()} m: it misses by "
                f"{np.linalg.norm(error[:3]):.3g} m; keep the path inside the arm's reach"
            )
        found[i] = q
    return found
