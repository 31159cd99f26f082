"""The ten numbers of a rigid body that its dynamics are linear in.

Mass ``m``, first moment ``h = m·c`` (three) and second moment ``I`` about the frame's origin (xx,
xy, yy, xz, yz, zz). Bodies that move together add, once they are expressed in one frame.

>>> import numpy as np
>>> ball = of_body(2.0, np.array([0.0, 0.0, 0.5]), np.zeros((3, 3)))
>>> ball.tolist()
[2.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.5, 0.0, 0.0, 0.0]
>>> moved(ball, np.eye(3), np.array([0.0, 0.0, -0.5])).round(12).tolist()
[2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from evertwin.types import Float64

Body: TypeAlias = Float64[np.ndarray, "10"]
Matrix: TypeAlias = Float64[np.ndarray, "3 3"]
Position: TypeAlias = Float64[np.ndarray, "3"]

NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
UNITS = ("kg", *("kg*m",) * 3, *("kgm2",) * 6)
_AT = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


def _packed(m: float, h: Position, second: Matrix) -> Body:
    return np.array([m, *h, *(second[i, j] for i, j in _AT)], dtype=np.float64)


def matrix(body: Body) -> Matrix:
    """The second moment about the origin as a matrix [kg m²]."""
    xx, xy, yy, xz, yz, zz = body[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)


def of_body(mass: float, centre: Position, inertia: Matrix) -> Body:
    """From the mass [kg], the centre of mass [m] and the inertia about it [kg m²]."""
    spread = np.dot(centre, centre) * np.eye(3) - np.outer(centre, centre)
    return _packed(mass, mass * centre, inertia + mass * spread)


def point(mass: float, centre: Position) -> Body:
    """A mass in one point.

    >>> point(1.0, np.array([0.0, 2.0, 0.0]))[4:].tolist()
    [4.0, 0.0, 0.0, 0.0, 0.0, 4.0]
    """
    return of_body(mass, centre, np.zeros((3, 3)))


def moved(body: Body, rotation: Matrix, position: Position) -> Body:
    """The same body in another frame: ``rotation`` and ``position`` of its frame in the new one.

    With ``S = tr(I)/2 − I``, the integral of ``x xᵀ`` over the mass, ``x ← R x + r`` gives
    ``S ← R S Rᵀ + (R h) rᵀ + r (R h)ᵀ + m r rᵀ``, linear in the ten numbers.
    """
    m, h, second = float(body[0]), rotation @ body[1:4], matrix(body)
    s = rotation @ (np.trace(second) / 2 * np.eye(3) - second) @ rotation.T
    cross = np.outer(h, position)
    s = s + cross + cross.T + m * np.outer(position, position)
    return _packed(m, h + m * position, np.trace(s) * np.eye(3) - s)
