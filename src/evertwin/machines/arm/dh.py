"""A serial arm from its Denavit-Hartenberg table: the same `Robot` as a URDF gives.

One row a joint. With the standard convention (Denavit and Hartenberg 1955; Paul 1981) the frame of
link i lies at its far end,

    A_i = Rot_z(θ_i) · Trans_z(d_i) · Trans_x(a_i) · Rot_x(α_i)

with the modified one (Craig 1986) at its joint, and a row holds the a and α before it,

    A_i = Rot_x(α_i) · Trans_x(a_i) · Rot_z(θ_i) · Trans_z(d_i)

where θ_i = theta + q_i for a joint that turns and d_i = d + q_i for one that slides. Centre of mass
and inertia are given in the axes of that frame, the inertia about the centre of mass.

>>> arm = robot_of([{"a": 0.5, "mass": 2.0, "com": [-0.25, 0.0, 0.0]}])
>>> arm.joints[0].name, arm.links["link1"].centre.tolist()
('joint1', [0.25, 0.0, 0.0])
>>> robot_of([{"a": 0.5, "alfa": 0.0}])
Traceback (most recent call last):
evertwin.errors.ModelError: dh: row 1: unknown key 'alfa', did you mean 'alpha'?
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evertwin.errors import ModelError, UsageError, nearest
from evertwin.machines.arm.inertia import Matrix, Position, checked
from evertwin.machines.arm.urdf import Joint, Link, Robot, rotation
from evertwin.settings.quantity import Measured, number
from evertwin.types import Float64

CONVENTIONS = ("standard", "modified")
BASE, TIP = "base", "tool"
_KEYS = (
    "name", "kind", "a", "alpha", "d", "theta", "mass", "com", "inertia", "low", "high", "speed",
)  # fmt: skip


def robot_of(
    rows: Sequence[Any],
    convention: str = "standard",
    before: Mapping[str, Any] | None = None,
    tool: Mapping[str, Any] | None = None,
) -> Robot:
    """The robot of a table.

    Args:
        rows: a table per joint: ``a`` [m], ``alpha`` [rad], ``d`` [m], ``theta`` [rad] (0 where
            left out), ``mass`` [kg], ``com`` (3) [m], ``inertia`` [kg m²] as
            ``[xx, yy, zz, xy, xz, yz]`` or ``[xx, yy, zz]``; ``kind`` ``revolute`` or
            ``prismatic``; ``name``; ``low``, ``high``, ``speed``. Numbers may be text with a unit,
            ``"90 deg"``.
        convention: ``standard`` or ``modified``.
        before: ``xyz`` [m] and ``rpy`` [rad] of the table's first frame in the base.
        tool: the same of the tip in the last frame.

    Raises:
        ModelError: names the row and what is wrong there.
    """
    if convention not in CONVENTIONS:
        raise ModelError(f"dh: convention {convention!r}, expected {' or '.join(CONVENTIONS)}")
    if not rows:
        raise ModelError("dh: expected a table with a row for each joint, got none")
    frame = _placed("before", before)
    links: dict[str, Link] = {BASE: Link(BASE)}
    joints: list[Joint] = []
    parent, names, notes = BASE, _named(rows), _notes(rows)
    for i, (row, name) in enumerate(zip(rows, names, strict=True)):
        at = f"dh: row {i + 1}"
        to_joint, to_frame = _frames(at, row, convention)
        child = f"link{i + 1}"
        links[child] = _link(at, child, row, to_frame, notes)
        joints.append(_joint(at, name, (parent, child), row, frame @ to_joint))
        parent, frame = child, to_frame
    last = frame @ _placed("tool", tool)
    links[TIP] = Link(TIP)
    joints.append(Joint("flange", "fixed", parent, TIP, last[:3, :3].copy(), last[:3, 3].copy()))
    return Robot("dh", links, tuple(joints), BASE, tuple(notes))


def _named(rows: Sequence[Any]) -> list[str]:
    for i, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise ModelError(f"dh: row {i + 1}: expected a table such as {{a = 0.4}}, got {row!r}")
        for key in row:
            if key not in _KEYS:
                raise ModelError(f"dh: row {i + 1}: unknown key {key!r}, {nearest(key, _KEYS)}")
    names = [str(row.get("name", f"joint{i + 1}")) for i, row in enumerate(rows)]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(f"dh: {names.count(name)} joints are called {name!r}: rename one")
    return names


def _slides(at: str, row: Mapping[str, Any]) -> bool:
    kind = row.get("kind", "revolute")
    if kind not in ("revolute", "continuous", "prismatic"):
        raise ModelError(f"{at}: kind {kind!r}, expected revolute, continuous or prismatic")
    return bool(kind == "prismatic")


def _value(at: str, row: Mapping[str, Any], key: str, unit: str, default: float = 0.0) -> float:
    return _number(f"{at}: {key}", row.get(key, default), unit)


def _number(what: str, value: Any, unit: str) -> float:
    try:
        size = number(value, unit)
    except (UsageError, TypeError, ValueError) as error:
        shown = value.written if isinstance(value, Measured) else value
        raise ModelError(f"{what}: expected a number in {unit}, got {shown!r}") from error
    if math.isnan(size):
        raise ModelError(f"{what}: expected a number in {unit}, got {value!r}")
    return size


def vector(what: str, value: Any, sizes: tuple[int, ...], unit: str) -> list[float]:
    """Numbers in SI from numbers or texts with a unit.

    Raises:
        ModelError: another count than one of ``sizes``, or not in ``unit`` or alike.

    >>> vector("xyz", [0, "20 cm", 1.0], (3,), "m")
    [0.0, 0.2, 1.0]
    """
    many = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    if not many or len(value) not in sizes:
        raise ModelError(f"{what}: expected {' or '.join(map(str, sizes))} numbers, got {value!r}")
    return [_number(what, v, unit) for v in value]


def _frames(
    at: str, row: Mapping[str, Any], convention: str
) -> tuple[Float64[np.ndarray, "4 4"], Float64[np.ndarray, "4 4"]]:
    """From the frame before to the joint's, and from the joint's to the row's own."""
    a, d = _value(at, row, "a", "m"), _value(at, row, "d", "m")
    alpha, theta = _value(at, row, "alpha", "rad"), _value(at, row, "theta", "rad")
    about_z, about_x = _frame((0.0, 0.0, theta), (0, 0, d)), _frame((alpha, 0.0, 0.0), (a, 0, 0))
    if convention == "modified":
        return about_x @ about_z, np.eye(4)
    return about_z, about_x


def _frame(rpy: Sequence[float], xyz: Sequence[float]) -> Float64[np.ndarray, "4 4"]:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation(*rpy), xyz
    return frame


def _placed(what: str, place: Mapping[str, Any] | None) -> Float64[np.ndarray, "4 4"]:
    if not place:
        return np.eye(4)
    for key in place:
        if key not in ("xyz", "rpy"):
            raise ModelError(f"{what}: unknown key {key!r}: there are xyz and rpy")
    said = {key: place.get(key, (0, 0, 0)) for key in ("rpy", "xyz")}
    rpy = vector(f"{what}.rpy", said["rpy"], (3,), "rad")
    return _frame(rpy, vector(f"{what}.xyz", said["xyz"], (3,), "m"))


def _link(
    at: str, name: str, row: Mapping[str, Any], frame: Float64[np.ndarray, "4 4"], notes: list[str]
) -> Link:
    """The body, from the row's frame into the joint's; remarks about it go to ``notes``."""
    for key in ("mass", "com"):
        if key not in row:
            raise ModelError(
                f"{at}: expected '{key}' (from the data sheet, CAD, or an experiment), got none"
            )
    mass = _value(at, row, "mass", "kg")
    centre: Position = np.array(vector(f"{at}: com", row["com"], (3,), "m"), dtype=np.float64)
    own = np.zeros((3, 3))
    if "inertia" in row:
        own = _tensor(vector(f"{at}: inertia", row["inertia"], (3, 6), "kgm2"))
    notes += checked(f"{at} (link '{name}')", mass, own if "inertia" in row else None)
    turn, place = frame[:3, :3], frame[:3, 3]
    return Link(name, mass, turn @ centre + place, turn @ own @ turn.T)


def _tensor(numbers: list[float]) -> Matrix:
    xx, yy, zz, xy, xz, yz = [*numbers, 0.0, 0.0, 0.0][:6]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)


def _joint(
    at: str,
    name: str,
    ends: tuple[str, str],
    row: Mapping[str, Any],
    frame: Float64[np.ndarray, "4 4"],
) -> Joint:
    slides = _slides(at, row)
    unit = "m" if slides else "rad"
    low, high = (
        _value(at, row, key, unit, start) for key, start in (("low", -math.inf), ("high", math.inf))
    )
    speed = _value(at, row, "speed", f"{unit}/s", math.inf)
    if not (low < high and speed > 0.0):
        raise ModelError(f"{at}: expected low < high and speed > 0, got {low}, {high} and {speed}")
    return Joint(
        name, str(row.get("kind", "revolute")), *ends, frame[:3, :3].copy(), frame[:3, 3].copy(),
        np.array([0.0, 0.0, 1.0]), low, high, speed,
    )  # fmt: skip


def _notes(rows: Sequence[Any]) -> list[str]:
    points = [str(i + 1) for i, row in enumerate(rows) if "inertia" not in row]
    if not points:
        return []
    return [f"rows {', '.join(points)} have no inertia: taken as masses in one point"]
