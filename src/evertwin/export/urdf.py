"""An arm as a URDF: its chain, the inertias as tuned, viscous and Coulomb friction.

Each joint's frame has the joint's axis as z, as the dynamics have it; what fixed joints connect is
one body, and a payload is part of the last. Friction goes into ``<dynamics>``: ``damping`` is Fv,
``friction`` is Fc. What a URDF has no place for (rotor inertias, offsets, other friction terms,
torque constants) stands in an element ``<evertwin>``, which readers pass over.

Base inertial parameters are combinations of links, not bodies: fitted freely they may come out as
something that no body is, and then no URDF can say them. That is refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader

from evertwin.errors import ModelError, UsageError
from evertwin.export.content import Exported
from evertwin.machines.arm import Arm
from evertwin.machines.arm.inertia import Body, Matrix, about_centre, checked
from evertwin.machines.friction.terms.coulomb import COULOMB
from evertwin.machines.friction.terms.viscous import VISCOUS

JOINT = 13
"""Numbers of the geometry per joint: rotation, position, kind."""
KEPT = tuple(term.coefficients[0].name for term in (VISCOUS, COULOMB))
"""Friction that a URDF has a place for: damping and friction."""


def urdf_bytes(out: Exported) -> bytes:
    """The file's content.

    Raises:
        UsageError: the model is no arm.
        ModelError: a tuned body is none.
    """
    arm = out.model
    if not isinstance(arm, Arm):
        raise UsageError(
            f"urdf: expected a model of kind 'arm', {out.name} is {out.kind!r}: use json or mat"
        )
    loader = PackageLoader("evertwin.export", "templates")
    environment = Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["numbers"] = _numbers
    values, chain = dict(zip(out.version.names, out.version.values, strict=True)), arm.chain
    bodies = zip(chain.links, arm.bodies(out.version.p), strict=True)
    page = environment.get_template("robot.urdf").render(
        out=out, links=[_link(name, body) for name, body in bodies],
        joints=[_joint(arm, k, values) for k in range(chain.n)], root=_free("base", arm),
        tool=_free("tool", arm), tip=_placed(chain.tool[:3, :3], chain.tool[:3, 3]),
    )  # fmt: skip
    return page.encode() + b"\n"


def _free(name: str, arm: Arm) -> str:
    """A name that no link has."""
    while name in arm.chain.links:
        name += "_"
    return name


def _link(name: str, body: Body) -> dict[str, Any]:
    """About the centre of mass, with axes parallel to the frame's."""
    mass, about = float(body[0]), f"urdf: link '{name}' as tuned"
    checked(about, mass, None)
    own = about_centre(body)
    try:
        checked(about, mass, own)
    except ModelError as error:
        raise ModelError(
            f"{error}; base parameters are combinations of links: export them as json"
        ) from error
    return {"name": name, "mass": mass, "centre": body[1:4] / mass, "inertia": own}


def _joint(arm: Arm, k: int, values: Mapping[str, float]) -> dict[str, Any]:
    chain = arm.chain
    numbers = chain.geometry[3 + JOINT * k : 3 + JOINT * (k + 1)]
    low, high, speed = chain.limits[k]
    bounded = math.isfinite(low) and math.isfinite(high)
    turning = "revolute" if bounded else "continuous"
    return {
        "name": chain.joints[k], "kind": "prismatic" if chain.sliding[k] else turning,
        "bounds": (low, high) if bounded else None,
        **{name: one if one < math.inf else 0.0  # a URDF's word for none
           for name, one in (("speed", speed), ("effort", chain.efforts[k]))},
        "friction": [values.get(f"{name}{k + 1}", 0.0) for name in KEPT],
        **_placed(numbers[:9].reshape(3, 3), numbers[9:12]),
    }  # fmt: skip


def _placed(rotation: Matrix, position: np.ndarray) -> dict[str, Any]:
    return {"xyz": position, "rpy": roll_pitch_yaw(rotation)}


def _numbers(values: Any) -> str:
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))


def roll_pitch_yaw(r: Matrix) -> np.ndarray:
    """Roll, pitch and yaw of a rotation, the inverse of `evertwin.machines.arm.urdf.rotation`."""
    level = math.hypot(r[0, 0], r[1, 0])
    pitch = math.atan2(-r[2, 0], level)
    if level < 1e-9:  # straight up or down: roll and yaw turn about the same line
        return np.array([math.atan2(-r[1, 2], r[1, 1]), pitch, 0.0])
    return np.array([math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])])
