"""Reading a URDF: links with their inertia, joints with their frames. Checked, never repaired.

Entities and external references are refused (defusedxml). Meshes are not read: the dynamics do
not need them; `Robot.notes` says which the file names.

>>> text = '''<robot name="pendulum"><link name="wall"/>
...   <link name="rod"><inertial><origin xyz="0 0 0.5"/><mass value="2"/>
...     <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.01"/></inertial></link>
...   <joint name="pivot" type="revolute"><parent link="wall"/><child link="rod"/>
...     <axis xyz="0 1 0"/></joint></robot>'''
>>> robot = parse(text)
>>> robot.root, robot.joints[0].name, robot.links["rod"].mass
('wall', 'pivot', 2.0)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from evertwin.errors import ModelError
from evertwin.machines.arm.inertia import Matrix, Position, checked

LARGEST = 8_000_000
"""Characters that a file may have."""
_MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, eq=False)
class Link:
    """A body, in the frame of the joint that carries it. No mass: a frame only.

    >>> Link("tool").mass
    0.0
    """

    name: str
    mass: float = 0.0
    centre: Position = field(default_factory=lambda: np.zeros(3))
    """Centre of mass [m]."""
    inertia: Matrix = field(default_factory=lambda: np.zeros((3, 3)))
    """About the centre, in the axes of the link's frame [kg m²]."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint: its child's frame in the parent's, and the axis in the child's.

    >>> Joint("j", "fixed", "a", "b").moves
    False
    """

    name: str
    kind: str
    parent: str
    child: str
    rotation: Matrix = field(default_factory=lambda: np.eye(3))
    position: Position = field(default_factory=lambda: np.zeros(3))
    axis: Position = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    low: float = -math.inf
    high: float = math.inf
    speed: float = math.inf
    effort: float = math.inf
    """Largest force or torque that the description gives it."""

    @property
    def moves(self) -> bool:
        """False for a fixed joint."""
        return self.kind != "fixed"


@dataclass(frozen=True, eq=False)
class Robot:
    """What a URDF says about the dynamics.

    >>> Robot("r", {}, (), "base").notes
    ()
    """

    name: str
    links: Mapping[str, Link]
    joints: tuple[Joint, ...]
    root: str
    """The link that no joint carries."""
    notes: tuple[str, ...] = ()
    """What was left out, for the user."""


def rotation(roll: float, pitch: float, yaw: float) -> Matrix:
    """Rotation by fixed axes x, y, z, the URDF's ``rpy`` [rad].

    >>> rotation(0.0, 0.0, np.pi / 2).round(12)[0].tolist()
    [0.0, -1.0, 0.0]
    """
    (a, b, c), (x, y, z) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [c * b, c * y * x - z * a, c * y * a + z * x],
            [z * b, z * y * x + c * a, z * y * a - c * x],
            [-y, b * x, b * a],
        ],
        dtype=np.float64,
    )


def read(path: Path | str) -> Robot:
    """The robot in a file.

    Raises:
        ModelError: the file is absent, is no URDF, or says something no machine can be.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path.name}: expected a readable URDF file: {error}") from error
    return parse(text, path.name)


def parse(text: str, where: str = "urdf") -> Robot:
    """The robot in a text; ``where`` and a line open every message."""
    if len(text) > LARGEST:
        raise ModelError(f"{where}: expected at most {LARGEST} characters, got {len(text)}")
    top = _tree(where, text)
    if top.tag != "robot":
        raise ModelError(f"{where}: expected a <robot> element on top, got <{top.tag}>")
    notes: list[str] = []
    links = {e.get("name", ""): _link(where, e, notes) for e in _unique(where, top.findall("link"))}
    joints = {e.get("name", ""): _joint(where, e) for e in _unique(where, top.findall("joint"))}
    lines = {e.get("name", ""): _at(where, e) for e in top.findall("joint")}
    root = _root(where, links, tuple(joints.values()), lines)
    notes += _meshes(where, top)
    return Robot(top.get("name", "robot"), links, tuple(joints.values()), root, tuple(notes))


_LINE = "line "
"""Attribute that keeps an element's line; no attribute of a file can hold a blank."""


class _Lined(TreeBuilder):
    """Elements that know their line."""

    parser: Any = None

    def start(self, tag: Any, attrs: Any, /) -> Any:
        return super().start(tag, {**attrs, _LINE: str(self.parser.CurrentLineNumber)})


def _tree(where: str, text: str) -> Element:
    builder = _Lined()
    parser = DefusedXMLParser(target=builder)
    builder.parser = parser.parser
    try:
        parser.feed(text)
        return parser.close()
    except (ParseError, DefusedXmlException, ValueError, RecursionError) as error:
        raise ModelError(f"{where}: expected plain XML without entities, got {error}") from error


def _at(where: str, element: Element) -> str:
    return f"{where}:{element.get(_LINE)}"


def _meshes(where: str, top: Element) -> list[str]:
    """Mesh files are never opened, whatever their names point at; it is said."""
    named = {m.get("filename", ""): _at(where, m) for m in top.iter("mesh")}
    notes = []
    if named:
        some = ", ".join(sorted(named)[:3])
        notes.append(f"{len(named)} mesh files are named and not read: {some} …")
    notes += [
        f"{line}: <mesh> names {name!r}, outside its package: it is not opened"
        for name, line in named.items()
        if ".." in name.replace("\\", "/").split("/") or name.startswith(("/", "file:", "http"))
    ]
    return notes


def _unique(where: str, elements: list[Element]) -> list[Element]:
    """The elements, each with a name of its own."""
    names = [_name(where, element) for element in elements]
    for element, name in zip(elements, names, strict=True):
        if names.count(name) > 1:
            raise ModelError(
                f"{_at(where, element)}: {element.tag} '{name}' occurs {names.count(name)} times: "
                "rename it"
            )
    return elements


def _only(where: str, element: Element, tag: str) -> Element | None:
    """The child of that kind, if there is one: which of several counts nobody knows."""
    found = element.findall(tag)
    if len(found) > 1:
        raise ModelError(
            f"{_at(where, found[1])}: expected one <{tag}> in <{element.tag}>, got {len(found)}: "
            "remove what does not count"
        )
    return found[0] if found else None


def _numbers(
    at: str, element: Element | None, key: str, default: str | None, count: int = 1
) -> list[float]:
    text = default if element is None else element.get(key, default)
    if text is None:
        raise ModelError(f"{at}: expected '{key}', got none: add it")
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise ModelError(f"{at}: expected {count} finite number(s) as '{key}', got {text!r}")
    return values


def _name(where: str, element: Element) -> str:
    name = element.get("name")
    if not name:
        raise ModelError(f"{_at(where, element)}: a <{element.tag}> has no name: give it one")
    return str(name)


def _link(where: str, element: Element, notes: list[str]) -> Link:
    name = _name(where, element)
    inertial = _only(where, element, "inertial")
    if inertial is None:
        return Link(name)
    at = f"{_at(where, inertial)}: link '{name}'"
    (mass,) = _numbers(at, _only(where, inertial, "mass"), "value", None)
    checked(at, mass, None)
    tensor = _only(where, inertial, "inertia")
    if tensor is None:
        raise ModelError(f"{at}: expected <inertia> beside <mass>, got none: add it")
    xx, xy, xz, yy, yz, zz = (
        _numbers(at, tensor, key, "0" if key in ("ixy", "ixz", "iyz") else None)[0]
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)
    if own.any():
        notes += checked(at, mass, own)
    else:
        notes.append(f"{at} has no inertia: taken as a mass in one point")
    origin = _only(where, inertial, "origin")
    turn = rotation(*_numbers(at, origin, "rpy", "0 0 0", 3))
    centre = np.array(_numbers(at, origin, "xyz", "0 0 0", 3))
    return Link(name, mass, centre, turn @ own @ turn.T)


def _joint(where: str, element: Element) -> Joint:
    name, kind = _name(where, element), element.get("type", "")
    at = f"{_at(where, element)}: joint '{name}'"
    if kind not in (*_MOVING, "fixed"):
        raise ModelError(f"{at} is '{kind}', expected one of {', '.join(_MOVING)} or fixed")
    if element.find("mimic") is not None:
        raise ModelError(f"{at} mimics another joint, expected a joint of its own")
    ends = [_only(where, element, tag) for tag in ("parent", "child")]
    parent, child = (e.get("link", "") if e is not None else "" for e in ends)
    if not parent or not child:
        raise ModelError(f"{at}: expected <parent link=…> and <child link=…>: add them")
    origin, limit = (_only(where, element, tag) for tag in ("origin", "limit"))
    axis = np.array(_numbers(at, _only(where, element, "axis"), "xyz", "1 0 0", 3))
    length = float(np.linalg.norm(axis))
    if kind != "fixed" and not length > 1e-9:
        raise ModelError(f"{at} has the axis {axis.tolist()}, expected a direction")
    free = kind in ("continuous", "fixed") or limit is None
    low, high = (
        (-math.inf, math.inf)
        if free
        else (_numbers(at, limit, "lower", "0")[0], _numbers(at, limit, "upper", "0")[0])
    )
    speed = _numbers(at, limit, "velocity", "0")[0] if limit is not None else 0.0
    return Joint(
        name, kind, parent, child,
        rotation(*_numbers(at, origin, "rpy", "0 0 0", 3)),
        np.array(_numbers(at, origin, "xyz", "0 0 0", 3)),
        axis / length if length > 1e-9 else axis, low, high, speed if speed > 0 else math.inf,
        math.inf if limit is None else _effort(limit),
    )  # fmt: skip


def _effort(limit: Element) -> float:
    """The largest force or torque; dynamics do not need it, so that nothing is refused for it."""
    try:
        effort = float(limit.get("effort", "0"))
    except ValueError:
        return math.inf
    return effort if effort > 0.0 else math.inf


def _root(
    where: str, links: Mapping[str, Link], joints: tuple[Joint, ...], lines: Mapping[str, str]
) -> str:
    """The one link that no joint carries; refuses two carriers, loops and loose parts."""
    above: dict[str, str] = {}
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ModelError(
                    f"{lines[joint.name]}: joint '{joint.name}' names link '{link}', which is "
                    "absent"
                )
        if joint.child in above:
            raise ModelError(
                f"{lines[joint.name]}: link '{joint.child}' is carried by two joints, one is "
                f"'{joint.name}': expected a tree"
            )
        above[joint.child] = joint.parent
    for start in above:
        seen, link = [start], above[start]
        while link in above and link != start and len(seen) <= len(above):
            seen.append(link)
            link = above[link]
        if link == start:
            at = next(lines[joint.name] for joint in joints if joint.child == start)
            raise ModelError(f"{at}: links {' → '.join([*seen, start])} form a loop: cut it")
    roots = [name for name in links if name not in above]
    if len(roots) != 1:
        raise ModelError(f"{where}: expected one root link, got {', '.join(roots) or 'none'}")
    return roots[0]
