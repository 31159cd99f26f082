"""A serial chain: the moving joints from the base to the tip, ready for compiled dynamics.

Each link's frame is that of its joint with the z axis turned onto the joint's axis. What is joined
by fixed joints is one body. A side branch that moves is refused: name the ``tip`` to choose one.

>>> from evertwin.machines.arm.urdf import Joint, Link, Robot
>>> rod = Link("rod", 2.0, np.array([0.0, 0.0, 0.5]), np.eye(3) * 0.1)
>>> pivot = Joint("pivot", "revolute", "wall", "rod", axis=np.array([0.0, 1.0, 0.0]))
>>> chain = serial(Robot("pendulum", {"wall": Link("wall"), "rod": rod}, (pivot,), "wall"))
>>> chain.joints, chain.inertia[:4].round(12).tolist()
(('pivot',), [2.0, 0.0, -1.0, 0.0])
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evertwin.errors import ModelError
from evertwin.machines.arm.inertia import Body, Matrix, Position, moved, of_body
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.arm.urdf import Joint, Robot
from evertwin.types import Float64

GRAVITY = (0.0, 0.0, -9.81)
"""In the base's frame [m/s²]: standing upright."""
JOINTS = 16
"""Joints that a compiled arm can have: ten reals each in one piece of working memory."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Geometry and inertia of a serial arm, as the kernels read them.

    >>> Chain((), (), np.zeros(3), np.zeros(0), np.eye(4), ()).n
    0
    """

    joints: tuple[str, ...]
    links: tuple[str, ...]
    """The link that each joint carries."""
    geometry: Float64[np.ndarray, " g"]
    """Gravity, then rotation, position and kind of every joint (`evertwin.machines.arm.rnea`)."""
    inertia: Float64[np.ndarray, " b"]
    """Ten numbers a link, in the link's frame."""
    tool: Float64[np.ndarray, "4 4"]
    """The tip's frame in the last link's frame."""
    limits: tuple[tuple[float, float, float], ...]
    """Lowest, highest position and highest speed of every joint."""
    sliding: tuple[bool, ...] = ()
    efforts: tuple[float, ...] = ()
    """Largest force or torque of every joint, as described."""
    notes: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def undescribed(self) -> tuple[str, ...]:
        """Links that nothing is known of: those without a mass. The last may be a flange, where
        others have one."""
        masses = self.inertia[::BODY]
        some = self.links[: self.n - bool(masses.any())]
        return tuple(link for link, mass in zip(some, masses, strict=False) if not mass > 0.0)


def aligned(axis: Position) -> Matrix:
    """The shortest rotation that turns z onto ``axis`` (a unit vector).

    >>> aligned(np.array([0.0, 1.0, 0.0])).round(12)[:, 2].tolist()
    [0.0, 1.0, 0.0]
    """
    x, y, z = axis.tolist()
    if z > 1.0 - 1e-15:
        return np.eye(3)
    if z < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    turn: Matrix = np.eye(3) + cross + cross @ cross / (1.0 + z)
    return turn


def _frame(rotation: Matrix, position: Position) -> Float64[np.ndarray, "4 4"]:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, position
    return frame


def _path(robot: Robot, tip: str | None, children: dict[str, list[Joint]]) -> list[Joint]:
    """Joints from the root to the tip; without a tip, to the end of the only moving chain."""
    if tip is not None:
        carried = {joint.child: joint for joint in robot.joints}
        path, link = [], tip
        if tip not in robot.links:
            raise ModelError(f"{robot.name}: no link '{tip}' to be the tip")
        while link != robot.root:
            path.append(carried[link])
            link = carried[link].parent
        return path[::-1]
    path, link = [], robot.root
    while children.get(link):
        ahead = [j for j in children[link] if _moves(j, children)]
        if len(ahead) > 1:
            names = ", ".join(j.name for j in ahead)
            raise ModelError(f"{robot.name}: link '{link}' branches into {names}: name the tip")
        path.append((ahead or children[link])[0])
        link = path[-1].child
    return path


def _moves(joint: Joint, children: dict[str, list[Joint]]) -> bool:
    return joint.moves or any(_moves(j, children) for j in children.get(joint.child, []))


def _body(robot: Robot, link: str, on: set[str], children: dict[str, list[Joint]]) -> Body:
    """The link with all that is fixed to it, in the link's frame; ``on``: joints of the path."""
    own = robot.links[link]
    total = of_body(own.mass, own.centre, own.inertia)
    for joint in children.get(link, []):
        if joint.moves:
            if joint.name not in on:
                raise ModelError(f"{robot.name}: joint '{joint.name}' moves beside the chain")
            continue
        part = _body(robot, joint.child, on, children)
        total = total + moved(part, joint.rotation, joint.position)
    return total


def serial(
    robot: Robot, tip: str | None = None, gravity: tuple[float, float, float] = GRAVITY
) -> Chain:
    """The chain from the robot's root to ``tip``.

    Raises:
        ModelError: no or too many moving joints, a moving branch. A moving link without mass is
            noted and taken as zero: the last one as a flange, others as not described.
    """
    children: dict[str, list[Joint]] = {}
    for joint in robot.joints:
        children.setdefault(joint.parent, []).append(joint)
    path = _path(robot, tip, children)
    moving = [joint for joint in path if joint.moves]
    if not 0 < len(moving) <= JOINTS:
        raise ModelError(f"{robot.name}: expected 1 to {JOINTS} moving joints, got {len(moving)}")
    on = {joint.name for joint in moving}
    reals, bodies = list(gravity), []
    frame = np.eye(4)
    for joint in path:
        frame = frame @ _frame(joint.rotation, joint.position)
        if not joint.moves:
            continue
        turn = aligned(joint.axis)
        here = frame[:3, :3] @ turn
        reals += [*here.ravel(), *frame[:3, 3], float(joint.kind == "prismatic")]
        body = moved(_body(robot, joint.child, on, children), turn.T, np.zeros(3))
        # What is zero but for rounding is zero: it has no size of its own.
        bodies.append(np.where(np.abs(body) < 1e-12 * np.abs(body).max(), 0.0, body))
        frame = _frame(turn.T, np.zeros(3))
    chain = Chain(
        tuple(j.name for j in moving), tuple(j.child for j in moving), np.array(reals),
        np.concatenate(bodies), frame, tuple((j.low, j.high, j.speed) for j in moving),
        tuple(j.kind == "prismatic" for j in moving), tuple(j.effort for j in moving), robot.notes,
    )  # fmt: skip
    return replace(chain, notes=chain.notes + _massless(chain))


def _massless(chain: Chain) -> tuple[str, ...]:
    """What is to be known of links without a mass."""
    unknown, last = chain.undescribed, chain.links[-1]
    if unknown:
        found = "base = true finds from recordings what torques need of them"
        return (f"without a mass, so unknown: {', '.join(unknown)}; {found}",)
    if chain.inertia[-BODY] > 0.0:
        return ()
    return (f"link '{last}' moves and has no mass: taken as zero, as it is the last one",)
