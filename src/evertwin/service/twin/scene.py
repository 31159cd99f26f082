"""What a machine looks like, as far as its model knows: the joints of an arm, the pose of a base.

An arm's model is inverse dynamics: it predicts torques at the pose that was measured, so its
simulated machine stands where the machine stands, and what differs is told joint by joint.

>>> from evertwin.machines.arm.model import Arm
>>> scene = scene_of(Arm.of("ur5_like"), 0.0)
>>> scene["kind"], len(scene["joints"]), scene["joints"][1]["input"]
('arm', 6, 'q2')
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from evertwin.machines.arm.model import Arm
from evertwin.machines.arm.rnea import JOINT
from evertwin.models import Model
from evertwin.models.tables.bodies import Plate, tables_of

POSE = ("x", "y", "heading")


def scene_of(model: Model, tolerance: float) -> Mapping[str, Any]:
    """In plain values; ``tolerance``: deviation [m] from which a base adopts what is measured."""
    if isinstance(model, Arm):
        tool = model.chain.tool.ravel().tolist()
        return {"kind": "arm", "joints": _joints(model), "tool": tool, "motors": _motors(model)}
    names = model.outputs.names
    if "x" in names:
        kind = "base" if "y" in names else "line"
        pose, tables = [n for n in POSE if n in names], tables_of(model.inputs.names)
        plate: Plate = getattr(model, "plate", Plate())  # of a world that takes tables
        told = {"tables": tables, "height": plate.height}
        return {"kind": kind, "pose": pose, "tolerance": tolerance, **told}
    return {"kind": "none"}


def _motors(arm: Arm) -> bool:
    """Are the angles those of motors, which a coupling makes the joints' of?"""
    return arm.coupling is not None and arm.coupling.motors


def _joints(arm: Arm) -> list[Mapping[str, Any]]:
    found: list[Mapping[str, Any]] = []
    for k, name in enumerate(arm.chain.joints):
        at = 3 + JOINT * k
        part = arm.chain.geometry[at : at + JOINT].tolist()
        found.append(
            {"name": name, "rotation": part[:9], "position": part[9:12], "slides": bool(part[12]),
             "input": arm.inputs.names[k], "speed": arm.inputs.names[k + len(arm.chain.joints)],
             "output": arm.outputs.names[k]}
        )  # fmt: skip
    return found
