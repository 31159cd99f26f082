"""A base as ROS shows it: where its simulation is, which way it came, where an update moved it, and
where that puts the frame of its odometry (REP-105: an update moves ``map → odom``).

>>> base = Base(("x",), size=0.4)
>>> cells = {"measured": [1.0], "predicted": [0.9], "sigma": [0.1], "update": [1]}
>>> [(step.before, step.after) for step in base.steps({"t": [0], "outputs": {"x": cells}})]
[((0.9, 0.0, 0.0), (1.0, 0.0, 0.0))]
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from evertwin.ros.transforms import Past, Pose, Transform, beyond, within

POSE = ("x", "y", "heading")
ORIGIN = (0.0, 0.0, 0.0)
UNKNOWN = (math.nan, math.nan, math.nan)
ADOPTED = (1, 3, 4)
"""What became of a measurement: position update, overruled the simulation, first sample."""
FIRST = 4
POSES = 500
"""Poses of a path."""
JUMPS = 200
"""Updates that are shown."""
APART = 0.125
"""Way between two poses of a path, as a share of the ghost's diameter."""
WAITING = 16
"""Poses that wait for the odometry of their time."""
OFTEN = 50_000_000
"""Nanoseconds between two times at which ``map → odom`` is told."""


class Step(NamedTuple):
    """One row.

    >>> Step(0, ORIGIN, (0.1, 0.0, 0.0), UNKNOWN, UNKNOWN, True).moved
    True
    """

    t: int
    before: Pose
    """As predicted."""
    after: Pose
    """As the simulation goes on from."""
    sigma: Pose
    """Of what is measured around the prediction; NaN: not known."""
    speed: Pose
    """Ahead, to the left [m/s], turning [rad/s]; NaN: not known."""
    moved: bool
    """Did it adopt what was measured?"""


class Base:
    """The simulated base so far. ``names``: its outputs, of `POSE`. See the module."""

    def __init__(self, names: Sequence[str], size: float) -> None:
        self._names, self._apart = tuple(names), APART * size
        self.way: deque[tuple[int, Pose]] = deque(maxlen=POSES)
        self.measured: deque[tuple[int, Pose]] = deque(maxlen=POSES)
        self.jumps: deque[tuple[Pose, Pose]] = deque(maxlen=JUMPS)
        """From where to where updates moved it."""
        self._last: tuple[int, Pose] | None = None

    def steps(self, rows: Mapping[str, Any]) -> Iterator[Step]:
        """Rows as a twin tells them; one without a prediction is left out."""
        for k, t in enumerate(rows["t"]):
            outputs = rows["outputs"]
            before = self._pose(outputs, "predicted", k)
            if not all(map(math.isfinite, before)):
                continue
            seen = self._pose(outputs, "measured", k)
            code = max(outputs[name]["update"][k] for name in self._names)
            after = before
            if code in ADOPTED:
                x, y, turn = (s if math.isfinite(s) else b for s, b in zip(seen, before))
                after = (x, y, turn)
            step = Step(
                t,
                before,
                after,
                self._pose(outputs, "sigma", k, math.nan),
                UNKNOWN if code == FIRST else self._speed(t, before),
                after != before,
            )
            self._keep(step, seen)
            yield step

    def _pose(
        self, outputs: Mapping[str, Any], column: str, k: int, other: float = 0.0
    ) -> tuple[float, float, float]:
        """``other``: of what its model does not tell."""
        x, y, heading = (
            _number(outputs[name][column][k]) if name in self._names else other for name in POSE
        )
        return x, y, heading

    def _speed(self, t: int, to: Pose) -> Pose:
        if self._last is None or t <= self._last[0]:
            return UNKNOWN
        seconds = (t - self._last[0]) * 1e-9
        ahead, left, turn = within(self._last[1], to)
        return ahead / seconds, left / seconds, turn / seconds

    def _keep(self, step: Step, seen: Pose) -> None:
        self._last = step.t, step.after
        if step.moved:
            self.jumps.append((step.before, step.after))
            self.way.append((step.t, step.before))
        self._go(self.way, step.t, step.after, always=step.moved)
        if all(map(math.isfinite, seen)):
            self._go(self.measured, step.t, seen)

    def _go(self, way: deque[tuple[int, Pose]], t: int, to: Pose, *, always: bool = False) -> None:
        if always or not way or math.dist(way[-1][1][:2], to[:2]) >= self._apart:
            way.append((t, to))


def _number(value: float | None) -> float:
    return math.nan if value is None else value


class Placing:
    """Where the frame of a machine's odometry is in the map. An update moves it; nothing else does.

    >>> placing = Placing("odom", "base_link")
    >>> placing.heard(Transform("odom", "base_link", 5, (1.0, 0.0, 0.0)), own=False)
    >>> placing.anchor(5, (1.5, 0.0, 0.0), update=True)
    >>> placing.odom
    (0.5, 0.0, 0.0)
    """

    def __init__(self, odom: str, base: str) -> None:
        self.frames = odom, base
        self.odom: Pose | None = None
        self.other = False
        """Somebody else places the frame."""
        self.due: int | None = None
        """Stamp at which it is to be told [ns]."""
        self._past = Past()
        self._wanted: deque[tuple[int, Pose]] = deque(maxlen=WAITING)
        self._told = -OFTEN

    @property
    def reason(self) -> str:
        """Why the frame is not placed."""
        odom, base = self.frames
        if self.other:
            return f"another node places {odom}: it is no longer placed from here"
        if self.odom is not None:
            return ""
        return f"nobody says {odom} → {base} on /tf" if self._wanted else "no row of the twin yet"

    def anchor(self, t: int, at: Pose, *, update: bool) -> None:
        """The machine was there at a time, by an update; or by the simulation, at the start."""
        if update or self.odom is None:
            self._wanted.append((t, at))
            self._place()

    def heard(self, one: Transform, *, own: bool) -> None:
        """Something was said on /tf; ``own``: from here."""
        odom = self.frames[0]
        if one.child == odom and not own:
            self.other = True
        if (one.parent, one.child) != self.frames:
            return
        self._past.add(one.t, one.pose)
        self._place()
        if self.odom is not None and not self.other and not 0 <= one.t - self._told < OFTEN:
            self._told = self.due = one.t

    def _place(self) -> None:
        """By the newest pose at whose time it is known where the odometry had the machine."""
        for k, (t, at) in reversed(list(enumerate(self._wanted))):
            there = self._past.at(t)
            if there is not None:
                self.odom = beyond(at, within(there, ORIGIN))
                self._wanted = deque(list(self._wanted)[k + 1 :], WAITING)
                return
