"""Joints of an arm that nobody describes: as many as there are angles with an effort beside them.

Headings that differ in one number alone (``AxisAct_A1 [°]`` … ``AxisAct_A5``, ``actual_q_0`` …)
say an angle and what turns it of each joint; without headings numbers say it, where one block of
columns is what another changes by. Of so many the bodies cannot be guessed: a URDF or a
Denavit-Hartenberg table says them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from evertwin.starter.channels.arm import bare_joints
from evertwin.starter.looks.families import families
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import quantity, role, words

LEAST, MOST = 4, 16
"""Fewer are axes, each a machine of its own."""
_EFFORTS = {"torque", "current", "force"}


def joints_of(seen: Sequence[Seen]) -> int:
    """How many joints have an angle and an effort that were measured; 0: it is no arm."""
    for count in range(MOST, LEAST - 1, -1):
        found = [_quantities(one, count) for one in seen]
        if any("position" in what and _EFFORTS & what for what in found):
            return count
        if bare_joints(seen, count):
            return count
    return 0


def _quantities(seen: Seen, count: int) -> set[str]:
    """What the families of exactly so many columns say that was measured."""
    columns = {column.name: column for column in seen.columns}
    out = set[str]()
    for family in families(tuple(columns), [f"joint {i}" for i in range(count)]):
        stem, hole = re.escape(family.stem), re.escape("#")
        alike = re.compile(stem.replace(hole, r"\d+"))
        there = [columns[name] for name in family.columns]
        moving = sum(one.low != one.high for one in there)
        if "#" not in family.stem or sum(map(bool, map(alike.fullmatch, columns))) != count:
            continue
        said = words(family.stem)
        slides = any(one.unit in ("m", "mm", "cm") for one in there)
        if 2 * moving > count and not slides and role(said) not in ("command", "other"):
            out.add(quantity(said, there[0].unit))
    return out


def stand_in(count: int) -> dict[str, Any]:
    """Options of an arm with so many joints, by which its channels are known; no body of it is."""
    return {
        "dh": [
            {"a": 0.1, "mass": 1.0, "com": [0.0, 0.0, 0.0], "inertia": [0.01, 0.01, 0.01]}
            for _ in range(count)
        ]
    }
