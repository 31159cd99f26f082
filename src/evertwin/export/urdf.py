"""An arm as a URDF: its chain, the inertias as tuned, viscous and Coulomb friction.

Each joint's frame has the joint's axis as z, as the dynamics have it; what fixed joints connect is
one body, and a payload is part of the last. Friction goes into ``<dynamics>``: ``damping`` is Fv,
``friction`` is Fc. What a URDF has no place for (rotor inertias, offsets, other friction terms,
torque constants) stands in an element ``<evertwin>``, which readers pass over.

Base inertial parameters are combinations of links, not bodies: fitted freely they may come out as
something that no body is, and then no URDF can say them. That is refused.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np

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
    values = dict(zip(out.version.names, out.version.values, strict=True))
    top = Element("robot", name=out.name)
    SubElement(top, "link", name=_root(arm))
    for k, body in enumerate(arm.bodies(out.version.p)):
        _link(top, arm.chain.links[k], body)
    for k in range(arm.chain.n):
        _joint(top, arm, k, values)
    _tool(top, arm)
    _rest(top, out)
    indent(top)
    with io.BytesIO() as buffer:
        ElementTree(top).write(buffer, encoding="utf-8", xml_declaration=True)
        return buffer.getvalue() + b"\n"


def _root(arm: Arm) -> str:
    return _free("base", arm)


def _free(name: str, arm: Arm) -> str:
    """A name that no link has."""
    while name in arm.chain.links:
        name += "_"
    return name


def _link(top: Element, name: str, body: Body) -> None:
    """About the centre of mass, with axes parallel to the frame's."""
    mass, about = float(body[0]), f"urdf: link '{name}' as tuned"
    checked(about, mass, None)
    centre = body[1:4] / mass
    own = about_centre(body)
    try:
        checked(about, mass, own)
    except ModelError as error:
        raise ModelError(
            f"{error}; base parameters are combinations of links: export them as json"
        ) from error
    inertial = SubElement(SubElement(top, "link", name=name), "inertial")
    SubElement(inertial, "origin", xyz=_numbers(centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(mass))
    at = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    SubElement(inertial, "inertia", {key: repr(float(own[i, j])) for key, (i, j) in at.items()})


def _joint(top: Element, arm: Arm, k: int, values: Mapping[str, float]) -> None:
    chain = arm.chain
    numbers = chain.geometry[3 + JOINT * k : 3 + JOINT * (k + 1)]
    low, high, speed = chain.limits[k]
    bounded = math.isfinite(low) and math.isfinite(high)
    turning = "revolute" if bounded else "continuous"
    kind = "prismatic" if chain.sliding[k] else turning
    joint = SubElement(top, "joint", name=chain.joints[k], type=kind)
    SubElement(joint, "parent", link=chain.links[k - 1] if k else _root(arm))
    SubElement(joint, "child", link=chain.links[k])
    _origin(joint, numbers[:9].reshape(3, 3), numbers[9:12])
    SubElement(joint, "axis", xyz="0 0 1")
    limit = {"effort": "0"}
    if bounded:
        limit |= {"lower": repr(float(low)), "upper": repr(float(high))}
    limit["velocity"] = repr(float(speed)) if math.isfinite(speed) else "0"
    SubElement(joint, "limit", limit)
    viscous, coulomb = (values.get(f"{name}{k + 1}", 0.0) for name in KEPT)
    SubElement(joint, "dynamics", damping=repr(float(viscous)), friction=repr(float(coulomb)))


def _tool(top: Element, arm: Arm) -> None:
    """The tip's frame, without a body."""
    tool = arm.chain.tool
    name = _free("tool", arm)
    SubElement(top, "link", name=name)
    joint = SubElement(top, "joint", name=f"{name}_joint", type="fixed")
    SubElement(joint, "parent", link=arm.chain.links[-1])
    SubElement(joint, "child", link=name)
    _origin(joint, tool[:3, :3], tool[:3, 3])


def _rest(top: Element, out: Exported) -> None:
    """Every parameter by name, so that nothing that was tuned is lost."""
    kept = SubElement(
        top, "evertwin", version=str(out.version.number), hash=out.version.hash,
        schema="evertwin.model/1",
    )  # fmt: skip
    for name, item in out.parameters.items():
        said = {"name": name, "value": repr(float(item["value"])), "unit": item["unit"]}
        SubElement(kept, "parameter", said)


def _origin(joint: Element, rotation: Matrix, position: np.ndarray) -> None:
    SubElement(joint, "origin", xyz=_numbers(position), rpy=_numbers(roll_pitch_yaw(rotation)))


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def roll_pitch_yaw(r: Matrix) -> np.ndarray:
    """Roll, pitch and yaw of a rotation, the inverse of `evertwin.machines.arm.urdf.rotation`."""
    level = math.hypot(r[0, 0], r[1, 0])
    pitch = math.atan2(-r[2, 0], level)
    if level < 1e-9:  # straight up or down: roll and yaw turn about the same line
        return np.array([math.atan2(-r[1, 2], r[1, 1]), pitch, 0.0])
    return np.array([math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])])
