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

from evertwin.errors import ModelError
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


def about_centre(body: Body) -> Matrix:
    """The inertia about the centre of mass of a body with a mass.

    >>> about_centre(of_body(2.0, np.array([0.3, 0.0, 0.0]), np.eye(3))).round(12).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    mass, centre = body[0], body[1:4] / body[0]
    spread = np.dot(centre, centre) * np.eye(3) - np.outer(centre, centre)
    return np.asarray(matrix(body) - mass * spread)


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


def checked(at: str, mass: float, inertia: Matrix | None) -> tuple[str, ...]:
    """Remarks about a body; ``inertia`` about its centre [kg m²], None for a point.

    Raises:
        ModelError: no machine can be so; opens with ``at``.
    """
    if not (mass > 0.0 and np.isfinite(mass)):
        raise ModelError(f"{at} has mass {mass:g} kg, expected > 0: a frame has no <inertial>")
    if inertia is None:
        return ()
    principal = np.linalg.eigvalsh(inertia)
    shown = ", ".join(f"{v:.3g}" for v in principal)
    if not principal[0] > 0.0:
        raise ModelError(
            f"{at} has an inertia with principal values {shown} kg m², expected all > 0: check "
            "ixx … izz"
        )
    if principal[2] > (principal[0] + principal[1]) * (1.0 + 1e-6):
        return (
            f"{at} has principal moments {shown} kg m²: no body has one above the sum of the "
            "others",
        )
    return ()
