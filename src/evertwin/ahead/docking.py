"""Docking: a mobile robot and a second machine, simulated together, exchanging their poses.

Both models step by the same time; after each step each gets the other's pose. The robot's target is
the dock, which the second machine moves; the second machine is told when the robot is near. The
approach is planned on the live version: turn towards the dock, drive, turn to its heading, each
with the constant command that makes the simulation arrive. The machine is told the same commands;
how far off it docks follows from what the parameters and the recordings leave open.

After Müller, Jazdi, Weyrich, "Self-improving Models for the Intelligent Digital Twin", section 4:
other components of the factory co-simulate docking with the robot's twin, to 2 cm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.ahead.basis import Basis, draws
from evertwin.ahead.spec import DockSpec
from evertwin.ahead.spread import spread
from evertwin.errors import UsageError
from evertwin.models import Model
from evertwin.rows.feed import Data
from evertwin.setup.newest import state_after
from evertwin.signals.units import compatible
from evertwin.types import Inputs, Json, ParameterVector, StateVector, Vector

DRAWS = 200
REST = 2
"""Steps at standstill after each part of the approach: a drive with lag rolls on."""
STILL = 0.01
"""Share of the way that is no motion."""
LONGER = 8
"""Times by which a part of the approach may be slower than commanded."""


class Partner(NamedTuple):
    """One of two machines that step together.

    >>> Partner._fields
    ('model', 'p', 'x')
    """

    model: Model
    p: ParameterVector
    x: StateVector
    """State before the first step."""


Tell = Callable[[int, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""``tell(step, outputs of the first, of the second) -> inputs of the first, of the second``."""


def cosimulate(
    first: Partner, second: Partner, tell: Tell, dt: float, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Two models side by side: outputs of each after every step, (steps, ny).

    What each is told follows from both outputs of the step before (NaN before the first).
    """
    x, z = first.x, second.x
    y, w = (np.full(len(m.model.outputs), np.nan) for m in (first, second))
    one, two = np.empty((steps, len(y))), np.empty((steps, len(w)))
    time = np.array([dt])
    for k in range(steps):
        u, v = tell(k, y, w)
        x, rows = first.model.simulate(x, u[None], time, first.p)
        z, others = second.model.simulate(z, v[None], time, second.p)
        y, w = rows[0], others[0]
        one[k], two[k] = y, w
    return one, two


@dataclass(frozen=True)
class Docking:
    """A docking as planned, and how it will end.

    >>> Docking.__name__
    'Docking'
    """

    seconds: float
    commands: Inputs
    """What the robot is told, step by step, (n, nu)."""
    robot: np.ndarray
    """Its simulated course, (n, ny)."""
    target: np.ndarray
    """The dock's course: x, y, heading, (n, 3)."""
    simulated: float
    """Position error at the end of the simulation [m]."""
    errors: np.ndarray
    """Position errors that the machine may end with, sorted [m]."""
    tolerance: float

    @property
    def error95(self) -> float:
        """Position error that is not exceeded with 95 % [m]."""
        return float(np.quantile(self.errors, 0.95))

    @property
    def probability(self) -> float:
        """That the position error stays within the tolerance."""
        return float(np.mean(self.errors <= self.tolerance))

    @property
    def holds(self) -> bool:
        """Within the tolerance with 95 %?"""
        return self.error95 <= self.tolerance

    def to_dict(self) -> Mapping[str, Json]:
        """Plain content."""
        median = float(np.median(self.errors))
        content: dict[str, Any] = {
            "seconds": self.seconds, "simulated_error": self.simulated, "error_median": median,
            "error95": self.error95, "tolerance": self.tolerance,
            "probability_within": self.probability, "holds": self.holds,
            "dock": self.target[-1], "robot": self.robot[-1], "commands": self.commands,
            "sentence": (
                f"after {self.seconds:.4g} s, position error {100 * median:.2g} cm (95 %: at most "
                f"{100 * self.error95:.2g} cm), within {100 * self.tolerance:g} cm with "
                f"probability {self.probability:.2f}"
            ),
        }  # fmt: skip
        return content


class _Axes(NamedTuple):
    """Columns of a base: forward speed, turn rate; x, y, heading (−1: it has none)."""

    forward: int
    turn: int
    x: int
    y: int
    heading: int


def _axes(model: Model) -> _Axes:
    """Which columns mean what.

    Raises:
        UsageError: the machine is no mobile base.
    """

    def first(units: list[str], unit: str, skip: int = 0) -> int:
        found = [k for k, one in enumerate(units) if one != "1" and compatible(one, unit)]
        return found[skip] if len(found) > skip else -1

    told, given = [c.unit for c in model.inputs], [c.unit for c in model.outputs]
    angles = np.flatnonzero(model.outputs.angles)
    axes = _Axes(
        first(told, "m/s"), first(told, "rad/s"), first(given, "m"), first(given, "m", 1),
        int(angles[0]) if len(angles) else -1,
    )  # fmt: skip
    if axes.forward < 0 or axes.x < 0:
        raise UsageError(
            "docking: expected a mobile base: a forward speed [m/s] in and a position [m] out, got "
            f"{', '.join(model.inputs.names)} and {', '.join(model.outputs.names)}"
        )
    return axes


@dataclass(frozen=True)
class _Plan:
    """The two machines and the rule; commands are found part by part."""

    robot: Partner
    second: Partner
    rule: DockSpec
    axes: _Axes

    def target(self, w: np.ndarray) -> np.ndarray:
        """The dock's pose for outputs of the second machine, (n, 3)."""
        place = np.tile(np.array((*self.rule.dock, 0.0, 0.0, 0.0)[:3]), (len(w), 1))
        if self.rule.output:
            column = self.second.model.outputs.index(self.rule.output)
            way = self.rule.lift * np.nan_to_num(w[:, column])
            place[:, 0] += way * np.cos(place[:, 2])
            place[:, 1] += way * np.sin(place[:, 2])
        return place

    def pose(self, y: np.ndarray) -> np.ndarray:
        """x, y, heading of the robot; 0 for what it has not, (n, 3)."""
        columns = [y[:, k] if k >= 0 else np.zeros(len(y)) for k in self.axes[2:]]
        return np.stack(columns, axis=1)

    def run(
        self, commands: Inputs, p: ParameterVector | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Both machines under the robot's commands."""
        robot = self.robot if p is None else self.robot._replace(p=p)
        names = self.second.model.inputs.names
        calm, called = (
            np.array([said.get(name, 0.0) for name in names])
            for said in (self.rule.command, {**self.rule.command, **self.rule.arrived})
        )
        near = [False]

        def tell(step: int, y: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            if step and not near[0]:
                apart = self.pose(y[None])[0] - self.target(w[None])[0]
                near[0] = bool(np.hypot(apart[0], apart[1]) <= self.rule.near)
            return commands[step], called if near[0] else calm

        return cosimulate(robot, self.second, tell, self.rule.step, len(commands))


def approach(plan: _Plan) -> Inputs:
    """The robot's commands: turn, drive, turn.

    Raises:
        UsageError: the dock is not reached within the longest approach.
    """
    nu, rule, axes = len(plan.robot.model.inputs), plan.rule, plan.axes
    commands = np.zeros((0, nu))

    def course(tail: Inputs) -> tuple[np.ndarray, np.ndarray]:
        y, w = plan.run(np.concatenate([commands, tail]))
        return plan.pose(y)[len(commands) :], plan.target(w)[len(commands) :]

    def facing(tail: Inputs) -> Vector:
        here, there = course(tail)
        way = there - here
        return _turned(np.arctan2(way[:, 1], way[:, 0]) - here[:, 2])

    def ahead(tail: Inputs) -> Vector:
        here, there = course(tail)
        way = there - here
        return np.asarray(way[:, 0] * np.cos(here[:, 2]) + way[:, 1] * np.sin(here[:, 2]))

    def aligned(tail: Inputs) -> Vector:
        here, there = course(tail)
        return _turned(there[:, 2] - here[:, 2])

    parts: list[tuple[int, float, Callable[[Inputs], Vector]]] = []
    turns = axes.turn >= 0 and axes.heading >= 0 and axes.y >= 0
    parts += [(axes.turn, rule.turn, facing)] if turns else []
    parts += [(axes.forward, rule.speed, ahead)]
    parts += [(axes.turn, rule.turn, aligned)] if turns else []
    for column, top, left in parts:
        commands = np.concatenate([commands, _part(plan, (column, top), left)])
    if len(commands) * rule.step > rule.limit:
        raise _too_long(len(commands) * rule.step, rule)
    return commands


def _too_long(seconds: float, rule: DockSpec) -> UsageError:
    return UsageError(
        f"docking: takes {seconds:g} s, more than {rule.limit:g} s: raise its limit or its speed"
    )


def _turned(angle: Vector) -> Vector:
    return angle - 2.0 * math.pi * np.rint(angle / (2.0 * math.pi))


def _part(plan: _Plan, told: tuple[int, float], left: Callable[[Inputs], Vector]) -> Inputs:
    """The constant command, and for how long, after which nothing is left to go.

    Args:
        plan: the two machines.
        told: column of the command, and the most of it.
        left: what is left to go after every step of commands, (n,).

    Raises:
        UsageError: it does not arrive.
    """
    column, top = told
    rest = np.zeros((REST, len(plan.robot.model.inputs)))
    way = float(left(rest[:1])[-1])
    if abs(way) < 1e-6:
        return rest[:0]
    sign = math.copysign(1.0, way)
    steps = max(1, math.ceil(abs(way) / (top * plan.rule.step)))
    if steps * plan.rule.step > plan.rule.limit:
        raise _too_long(steps * plan.rule.step, plan.rule)

    def of(size: float, count: int) -> Inputs:
        tail = np.zeros((count + REST, rest.shape[1]))
        tail[:count, column] = sign * size
        return tail

    longest = sign * left(of(top, LONGER * steps))
    there = np.flatnonzero(longest <= 0.0)
    # while it rests it gets no farther than with the command that goes on
    first = max(steps, int(there[0]) + 1 - REST) if len(there) else LONGER * steps + 1
    for count in range(first, LONGER * steps + 1):
        if sign * left(of(top, count))[-1] <= 0.0:
            # the fastest command overshoots: one below it arrives, unless the drive jumps over it
            def remaining(size: float, count: int = count) -> float:
                return float(sign * left(of(size, count))[-1])

            size = float(scipy.optimize.brentq(remaining, 0.0, top, xtol=1e-9))
            return of(size, count)
    name = f"{plan.robot.model.inputs.names[column]} = {top:g}"
    if np.ptp(longest[len(longest) // 2 :]) < STILL * abs(way):
        raise UsageError(
            f"docking: the dock cannot be reached: with {name} the simulated robot does not move, "
            "it is below what its drive starts at: raise the speed"
        )
    raise UsageError(
        f"docking: the simulated robot does not arrive with {name} in {LONGER} times the way's "
        "time: raise the speed"
    )


def dock(basis: Basis, second: Basis, rule: DockSpec, data: Data = None) -> Docking:
    """Plans a docking on the live version and says how it will end.

    Args:
        basis: the mobile robot's live version.
        second: that of the second machine.
        rule: dock and approach.
        data: the robot's recordings; it starts where they end.

    Raises:
        UsageError: no mobile base, or the dock is not reached.
        DataError: no recordings.
    """
    rows, model, p = basis.rows(data), basis.model, basis.p
    other = second.model
    for name in {**rule.command, **rule.arrived}:
        other.inputs.index(name)  # names the nearest one
    plan = _Plan(
        Partner(model, p, state_after(model, p, rows[-1])),
        Partner(other, second.p, other.initial(second.p)), rule, _axes(model),
    )  # fmt: skip
    commands = approach(plan)
    y, w = plan.run(commands)
    seconds = len(commands) * rule.step
    known = spread(model, p, basis.alike(rows), seconds)
    sigma = known.sigma(np.array([seconds]))[0]
    rng = np.random.default_rng(4)
    ps = draws(model, p, basis.sigma, DRAWS, seed=5)
    mine = np.stack([plan.run(commands, q)[0][-1] for q in ps]) if basis.sigma.any() else y[-1:]
    other_p = draws(other, second.p, second.sigma, DRAWS, seed=6)
    theirs = w[-1:]
    if second.sigma.any():
        theirs = np.stack([
            replace(plan, second=plan.second._replace(p=q)).run(commands)[1][-1] for q in other_p
        ])  # fmt: skip
    places = plan.pose(np.broadcast_to(mine, (DRAWS, mine.shape[1]))).copy()
    for column, k in ((0, plan.axes.x), (1, plan.axes.y)):
        if k >= 0:
            places[:, column] += sigma[k] * rng.standard_normal(DRAWS)
    goals = plan.target(np.broadcast_to(theirs, (DRAWS, theirs.shape[1])))
    ends = plan.pose(y)[-1] - plan.target(w)[-1]
    return Docking(
        seconds, commands, y, plan.target(w), float(np.hypot(*_plane(plan, ends[None])[0])),
        np.sort(np.hypot(*_plane(plan, places - goals).T)), rule.tolerance,
    )  # fmt: skip


def _plane(plan: _Plan, apart: np.ndarray) -> np.ndarray:
    """Differences in the plane; along the line alone where the robot knows no other."""
    found = apart[:, :2].copy()
    if plan.axes.y < 0:
        found[:, 1] = 0.0
    return found
