"""A serial chain as MJCF, for MuJoCo: the same bodies in another engine's words.

Moments of inertia go over as principal moments with their axes, so that no rounding of the other
engine's own is added.

>>> from evertwin.machines.arm.dh import robot_of
>>> from evertwin.machines.arm.chain import serial
>>> rod = [{"a": 0.5, "mass": 2.0, "com": [-0.25, 0, 0], "inertia": [0.01, 0.05, 0.05]}]
>>> text = mjcf_of(serial(robot_of(rod)))
>>> 'mass="2.0"' in text, text.count("<joint")
(True, 1)
"""

from __future__ import annotations

import numpy as np

from evertwin.errors import ModelError, naming
from evertwin.machines.arm.chain import Chain
from evertwin.machines.arm.inertia import Body, Matrix, Position, about_centre
from evertwin.machines.arm.rnea import BODY, JOINT


def central(body: Body) -> tuple[float, Position, Matrix]:
    """Mass, centre of mass and inertia about it, of the ten numbers.

    Raises:
        ModelError: no body has these numbers: the mass or a principal moment is not above zero, or
            one moment is above the sum of the others.

    >>> from evertwin.machines.arm.inertia import of_body
    >>> mass, centre, own = central(of_body(2.0, np.array([0.0, 0.0, 0.5]), np.eye(3)))
    >>> mass, centre.tolist(), own.round(12).tolist()[0]
    (2.0, [0.0, 0.0, 0.5], [1.0, 0.0, 0.0])
    """
    mass = float(body[0])
    if not mass > 0.0:
        raise ModelError(f"mass {mass:.3g} kg is not above zero")
    centre = body[1:4] / mass
    own = about_centre(body)
    a, b, c = np.linalg.eigvalsh(own).tolist()
    # Beside what rounding leaves of zero.
    if max(abs(a), abs(c)) <= 1e-14 * mass * max(1.0, float(np.dot(centre, centre))):
        raise ModelError("a mass in one point is no body for other engines: give its inertia")
    if not (a > 0.0 and c <= (a + b) * (1.0 + 1e-9)):
        raise ModelError(f"principal moments {a:.3g}, {b:.3g}, {c:.3g} kg m² are those of no body")
    return mass, centre, own


def mjcf_of(chain: Chain, gravity: bool = True) -> str:
    """The chain with its inertias, without friction, rotors, contact or limits.

    Raises:
        ModelError: a link's ten numbers are those of no body; names the link.
    """
    pull = chain.geometry[:3] if gravity else np.zeros(3)
    text = (
        f'<mujoco><compiler angle="radian" autolimits="false"/><option gravity="{_words(pull)}">'
        '<flag contact="disable" constraint="disable"/></option><worldbody>'
    )
    for j in range(chain.n):
        at = 3 + JOINT * j
        turn = chain.geometry[at : at + 9].reshape(3, 3)
        place = chain.geometry[at + 9 : at + 12]
        kind = "slide" if chain.sliding[j] else "hinge"
        text += (
            f'<body name="{j}:{_name(chain.links[j])}" pos="{_words(place)}" '
            f'xyaxes="{_words(turn[:, 0])} {_words(turn[:, 1])}">'
            f"{_inertial(chain, j)}"
            f'<joint name="{j}:{_name(chain.joints[j])}" type="{kind}" axis="0 0 1"/>'
        )
    return text + "</body>" * chain.n + "</worldbody></mujoco>"


def _inertial(chain: Chain, j: int) -> str:
    with naming(f"link '{chain.links[j]}'", ModelError, ModelError):
        mass, centre, own = central(chain.inertia[BODY * j : BODY * (j + 1)])
    moments, axes = np.linalg.eigh(own)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] = -axes[:, 2]
    return (
        f'<inertial mass="{_words([mass])}" pos="{_words(centre)}" diaginertia="{_words(moments)}" '
        f'xyaxes="{_words(axes[:, 0])} {_words(axes[:, 1])}"/>'
    )


def _words(numbers: np.ndarray | list[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def _name(text: str) -> str:
    return "".join(c if c.isalnum() or c in "_-." else "_" for c in text)
