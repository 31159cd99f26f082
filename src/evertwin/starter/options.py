"""Which options of a model a first twin file tries."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from evertwin.errors import UsageError
from evertwin.starter.looks.joint_count import told_joints
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import ASK

BUILT_IN, JOINTS = "ur5_like", 6
"""The description of an arm of which none is given, and its joints."""


def stands_in(options: Mapping[str, Any]) -> str:
    """What was taken for a description that nobody gave, and what to give; empty: nothing.

    >>> stands_in({"urdf": "arm.urdf"})
    ''
    """
    if options.get("urdf") != BUILT_IN:
        return ""
    return f"bodies of {BUILT_IN}, as no description was given: give the arm's own, --urdf FILE"


def needs_description(seen: Sequence[Seen], missing: Collection[str]) -> str:
    """Why an arm cannot be taken for the built-in one; empty: it can.

    Args:
        seen: the tables.
        missing: channels of that one that found no column.
    """
    joints = told_joints(seen)
    if joints in (0, JOINTS) and "q1" not in missing:
        return ""
    told = f"of {joints} joints" if joints not in (0, JOINTS) else f"not told for {JOINTS} joints"
    return (
        f"the columns are {told}, and {BUILT_IN}, which is built in, has {JOINTS}: give the arm's "
        "own description, --urdf FILE"
    )


def answered(options: dict[str, Any]) -> dict[str, Any]:
    """Options but for those that are asked.

    >>> answered({"wheel_base": ASK, "front_drive": True})
    {'front_drive': True}
    """
    return {name: said for name, said in options.items() if said != ASK}


def options_of(kind: str, urdf: Path | None, own: Path) -> Sequence[dict[str, Any]]:
    """Options of the model; several to choose from by what the columns answer.

    >>> options_of("drive", None, Path("model.py"))
    [{}, {'rotary': True, 'law': 'sign+spring+balance'}]
    """
    if urdf is not None and kind != "arm":
        raise UsageError(f"--urdf is for --model arm, got --model {kind}")
    if kind == "python":
        return [{"file": own.name, "name": "model"}]
    if kind == "drive":
        return [{}, {"rotary": True, "law": "sign+spring+balance"}]
    if kind == "drive_force":  # of the place, where one is recorded; of an angle what repeats
        law = "sign+direction+two_sided+stribeck+root"
        slides, turns = f"{law}+spring", f"{law}+position+spring+balance"
        return [{"law": slides}, {"law": law}, {"law": turns, "rotary": True},
                {"law": law, "rotary": True}]  # fmt: skip
    if kind == "differential":  # of wheels that turn, where no column is a speed of the base
        return [{"wheels": True, "wheel_radius": ASK, "wheel_base": ASK}, {}]
    if kind == "bicycle":
        return [{"wheel_base": ASK, "front_drive": ASK}]
    if kind != "arm":
        return [{}]
    # a description's inertias are a start: friction alone would have to explain what they leave
    described = BUILT_IN if urdf is None else str(urdf)
    return [{"urdf": described, "law": "tanh+load", "base": True, "payload": True}]
