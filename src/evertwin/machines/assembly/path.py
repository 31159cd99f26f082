"""Path planning: from a list of moves to joint positions, speeds and accelerations over time.

A move says *where* (joint positions, a straight line or a circle of the tool, a pause), a profile
says *when*: ``trapezoid`` (constant acceleration, constant speed, constant deceleration) or
``quintic`` (acceleration zero at both ends). The slowest joint sets the pace and the others keep
step, so that all stop together. A path of the tool is turned into joint positions once, point by
point, and then travelled as the profile says; where a joint would pass its limits the whole move is
slowed down. Every move starts and ends at rest, on a row.

>>> motion = plan([Joints((1.0,)), Pause(0.5)], [0.0], Limits((1.0,), (2.0,)), rate=100.0)
>>> motion.t[-1].item(), motion.q[-1].tolist(), motion.qd[-1].tolist()
(2.0, [1.0], [0.0])
>>> float(abs(motion.qd).max().round(9)), float(abs(motion.qdd).max().round(9))
(1.0, 2.0)

Profiles as in Biagiotti and Melchiorri, "Trajectory planning for automatic machines and robots"
(2008).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import scipy

from evertwin.errors import UsageError, naming
from evertwin.machines.arm.chain import Chain
from evertwin.machines.assembly.kinematics import follow, tool
from evertwin.settings.quantity import in_unit
from evertwin.types import Float64, Vector

Profile: TypeAlias = Literal["trapezoid", "quintic"]
GRID = 0.005
"""Distance of the points at which a path of the tool is solved for the joints [m]."""
LONGEST = 20_000
"""Such points of one move."""
MOST = 1_000_000
"""Rows of one move."""


@dataclass(frozen=True)
class Limits:
    """Highest speed and acceleration of every joint [rad/s, rad/s²; m/s, m/s²].

    >>> Limits((1.0,), (2.0,)).speed
    (1.0,)
    """

    speed: tuple[float, ...]
    acceleration: tuple[float, ...]

    def __post_init__(self) -> None:
        numbers = (*self.speed, *self.acceleration)
        if len(self.speed) != len(self.acceleration) or not all(x > 0 for x in numbers):
            raise UsageError(
                f"limits: expected a speed and an acceleration above 0 for every joint, "
                f"got {self.speed} and {self.acceleration}"
            )


@dataclass(frozen=True)
class Joints:
    """To joint positions ``to``, all joints together.

    >>> Joints((0.0, 1.0)).to
    (0.0, 1.0)
    """

    to: tuple[float, ...]


@dataclass(frozen=True)
class Line:
    """The tool to the point ``to`` [m] on a straight line, its orientation kept.

    >>> Line((0.4, 0.1, 0.3)).speed
    0.25
    """

    to: tuple[float, float, float]
    speed: float = 0.25
    """Highest speed of the tool [m/s]."""
    acceleration: float = 1.0
    """Highest acceleration of the tool along the path [m/s²]."""


@dataclass(frozen=True)
class Circle:
    """The tool round ``centre`` [m], about ``axis``, its orientation kept.

    >>> Circle((0.4, 0.1, 0.3), turns=2.0).axis
    (0.0, 0.0, 1.0)
    """

    centre: tuple[float, float, float]
    turns: float = 1.0
    """Negative: the other way round."""
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    speed: float = 0.25
    """Highest speed of the tool [m/s]."""
    acceleration: float = 1.0
    """Highest acceleration of the tool along the path [m/s²]."""


@dataclass(frozen=True)
class Pause:
    """Stand still for ``seconds``.

    >>> Pause(0.5).seconds
    0.5
    """

    seconds: float


Move: TypeAlias = Joints | Line | Circle | Pause
_MOVES: Mapping[str, type[Move]] = {
    "joints": Joints,
    "line": Line,
    "circle": Circle,
    "pause": Pause,
}


_UNITS = {"to": "m", "centre": "m", "speed": "m/s", "acceleration": "m/s**2", "seconds": "s"}


class Motion(NamedTuple):
    """A planned motion.

    >>> Motion._fields
    ('t', 'q', 'qd', 'qdd')
    """

    t: Float64[np.ndarray, " n"]
    """[s] from 0, at the fixed rate."""
    q: Float64[np.ndarray, "n joints"]
    """[rad], [m] where a joint slides."""
    qd: Float64[np.ndarray, "n joints"]
    qdd: Float64[np.ndarray, "n joints"]


class _Run(NamedTuple):
    """A profile over one move: share of the way, its speed [1/s] and acceleration [1/s²]."""

    s: Vector
    v: Vector
    a: Vector


def moves_of(program: Sequence[Mapping[str, Any]]) -> tuple[Move, ...]:
    """Moves from plain data, each ``{ move = "joints" | "line" | "circle" | "pause", … }``.

    Raises:
        UsageError: an unknown move, an entry that it does not have, or a unit of another kind.

    >>> moves_of([{"move": "pause", "seconds": 1.0}])
    (Pause(seconds=1.0),)
    """
    moves = []
    for k, entry in enumerate(program, start=1):
        kind = str(entry.get("move"))
        if kind not in _MOVES:
            raise UsageError(f"path, move {k}: no move {kind!r}; there are {', '.join(_MOVES)}")
        with naming(f"path, move {k} ({kind})", (TypeError, UsageError)):
            given = {key: _si(kind, key, v) for key, v in entry.items() if key != "move"}
            moves.append(_MOVES[kind](**given))
    return tuple(moves)


def _si(kind: str, key: str, value: Any) -> Any:
    """An entry of a move in SI; a joint's position is checked where it is known what it measures.

    Raises:
        UsageError: it measures something else.
    """
    if isinstance(value, list | tuple):
        return tuple(_si(kind, key, one) for one in value)
    unit = "" if kind == "joints" else _UNITS.get(key, "")
    return in_unit(key, value, unit) if unit else value


def plan(
    moves: Sequence[Move],
    start: Sequence[float],
    limits: Limits,
    rate: float = 100.0,
    profile: Profile = "trapezoid",
    chain: Chain | None = None,
) -> Motion:
    """The motion through ``moves``.

    Args:
        moves: in order.
        start: joint positions at the start, (n,).
        limits: of the joints; a path of the tool is slowed down until it keeps them.
        rate: rows a second [Hz].
        chain: the arm's geometry, needed for lines and circles (`Arm.chain`).

    Raises:
        UsageError: a wrong number of joints, a place out of reach, a line without a chain.
    """
    q = np.array(start, dtype=np.float64)
    if len(q) != len(limits.speed) or profile not in ("trapezoid", "quintic") or not rate > 0:
        raise UsageError(
            f"path: expected {len(limits.speed)} joints, 'trapezoid' or 'quintic' and a rate above "
            f"0 Hz, got {len(q)} joints, {profile!r}, {rate:g} Hz"
        )
    pieces = [(q[None], np.zeros((1, len(q))), np.zeros((1, len(q))))]
    for move in moves:
        piece = _travel(move, q, limits, (rate, profile), chain)
        q = piece[0][-1]
        pieces.append(piece)
    all_q, all_v, all_a = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return Motion(np.arange(len(all_q)) / rate, all_q, all_v, all_a)


def _travel(
    move: Move, q: Vector, limits: Limits, timing: tuple[float, Profile], chain: Chain | None
) -> tuple[Any, Any, Any]:
    """Rows after the first of one move."""
    rate, profile = timing
    if isinstance(move, Pause):
        rows = _rows(float(np.round(move.seconds * rate)), 0)
        still = np.zeros((rows, len(q)))
        return np.tile(q, (rows, 1)), still, still
    if isinstance(move, Joints):
        if len(move.to) != len(q):
            raise UsageError(f"path: expected {len(q)} joint positions, got {len(move.to)}")
        way = np.array(move.to) - q
        size = np.maximum(np.abs(way), 1e-300)
        pace = float((limits.speed / size).min()), float((limits.acceleration / size).min())
        run = _run(*pace, rate, profile)
        return q + run.s[:, None] * way, run.v[:, None] * way, run.a[:, None] * way
    if chain is None:
        raise UsageError(f"path: a {type(move).__name__.lower()} needs an arm's geometry: a chain")
    length, places = _places(move, chain, q)
    points = np.linspace(0.0, 1.0, _rows(length / GRID, 8, LONGEST) + 1)
    joints = follow(chain, q, places(points), tool(chain, q)[0][:3, :3])
    spline = scipy.interpolate.CubicSpline(points, joints)
    speed, acceleration = move.speed / length, move.acceleration / length
    travelled = _along(spline, _run(speed, acceleration, rate, profile))
    slower = 1.0
    # rows of a slower run lie elsewhere, where the peak may show a little higher
    while (excess := _excess(travelled, limits)) > 1.0:
        slower *= max(excess, 1.001)
        run = _run(speed / slower, acceleration / slower**2, rate, profile)
        travelled = _along(spline, run)
    return travelled


def _places(move: Line | Circle, chain: Chain, q: Vector) -> tuple[float, Any]:
    """Length of the tool's path [m], and its points as a function of the share of the way."""
    here = tool(chain, q)[0][:3, 3]
    if isinstance(move, Line):
        way = np.array(move.to) - here
        return max(float(np.linalg.norm(way)), 1e-9), lambda s: here + s[:, None] * way
    axis = np.array(move.axis) / np.linalg.norm(move.axis)
    arm = here - np.array(move.centre)
    across = arm - axis * (axis @ arm)
    side, angle = np.cross(axis, across), 2.0 * np.pi * move.turns

    def places(s: Vector) -> Any:
        turn = np.cos(angle * s)[:, None] * across + np.sin(angle * s)[:, None] * side
        return here - across + turn

    return max(float(np.linalg.norm(across)) * abs(angle), 1e-9), places


def _along(spline: scipy.interpolate.CubicSpline, run: _Run) -> tuple[Any, Any, Any]:
    """A path by its share of the way, travelled as a profile says."""
    first, second = spline(run.s, 1), spline(run.s, 2)
    v, a = run.v[:, None], run.a[:, None]
    return spline(run.s), first * v, second * v**2 + first * a


def _excess(rows: tuple[Any, Any, Any], limits: Limits) -> float:
    """How many times slower the rows must run to keep the limits; 1 or less: they do."""
    _, v, a = rows
    speed = np.max(np.abs(v) / limits.speed)
    return float(max(speed, np.sqrt(np.max(np.abs(a) / limits.acceleration))))


def _run(speed: float, acceleration: float, rate: float, profile: Profile) -> _Run:
    """A profile over the way 0 … 1 that ends on a row."""
    if profile == "quintic":
        needed = max(1.875 / speed, math.sqrt(10.0 / math.sqrt(3.0) / acceleration))
        rows = _rows(needed * rate, 1)
        return _quintic(rows, rows / rate)
    ramp = speed / acceleration
    if ramp * speed > 1.0:
        ramp = math.sqrt(1.0 / acceleration)
        needed = 2.0 * ramp
    else:
        needed = ramp + 1.0 / speed
    rows = _rows(needed * rate, 1)
    return _trapezoid(rows, rows / rate, ramp / needed)


def _rows(size: float, least: int, most: int = MOST) -> int:
    """So many rows, or more to end on one.

    Raises:
        UsageError: far too many.
    """
    if not size <= most:
        raise UsageError(
            f"path: a move of {size:.3g} rows: expected at most {most}: shorten it, or lower rate"
        )
    return max(least, math.ceil(size - 1e-9))


def _quintic(rows: int, duration: float) -> _Run:
    x = np.arange(1, rows + 1) / rows
    return _Run(
        x**3 * (10.0 + x * (6.0 * x - 15.0)),
        30.0 * x**2 * (1.0 - x) ** 2 / duration,
        60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / duration**2,
    )


def _trapezoid(rows: int, duration: float, share: float) -> _Run:
    """``share``: the part of the duration that each ramp takes, at most a half."""
    x = np.arange(1, rows + 1) / rows
    top, left = 1.0 / (1.0 - share), 1.0 - x
    rising, falling = x < share, left < share
    s = np.where(rising, 0.5 * top * x**2 / share, top * (x - 0.5 * share))
    s = np.where(falling, 1.0 - 0.5 * top * left**2 / share, s)
    v = np.where(rising, top * x / share, np.where(falling, top * left / share, top))
    a = np.where(rising, top / share, np.where(falling & (left > 0.0), -top / share, 0.0))
    return _Run(s, v / duration, a / duration**2)
