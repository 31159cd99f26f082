"""A robot that drives rounds in a hall, past tables one of which is moved, and then at tables.

Hall, lidar and people are those of `planted.halls`. The machine is a MuJoCo body with motors that
push it at the speeds it is told, and stops at legs that stand there; it is not the twin's: it is
heavier, and slower than it is told. Where it is it knows itself; scans are all that anybody else is
given beside the commands.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from evertwin.signals.planar import between
from planted.halls import LIDARS, Hall, free_place, hall, lane, legs, met, people
from planted.rooms import ranges

RADIUS, SPEED, NEAREST, FARTHEST = 0.2, 0.3, 0.7, 2.2
"""Of the robot [m]; at which it is driven at a table [m/s], from how near and far [m]."""
STEP, AHEAD = 0.005, 5
"""Of the machine [s]; points of the way that the robot looks ahead."""

CART = """<mujoco><option timestep="0.005"/><worldbody>{around}
<body name="cart" pos="{x} {y} 0.15"><joint name="x" type="slide" axis="1 0 0"/>
<joint name="y" type="slide" axis="0 1 0"/><joint name="heading" axis="0 0 1" ref="{turn}"/>
<geom type="cylinder" size="0.2 0.1" mass="{mass}" friction="0.3"/><site name="middle"/>
</body></worldbody><actuator>
<velocity name="v" site="middle" gear="1 0 0 0 0 0" kv="400" forcerange="-60 60"/>
<velocity name="side" site="middle" gear="0 1 0 0 0 0" kv="400" forcerange="-60 60"/>
<velocity name="w" joint="heading" kv="20"/></actuator></mujoco>"""

TWIN = """schema = 1
name = "cart"
beat = "5 s"

[model]
kind = "mujoco"

[model.options]
file = "cart.xml"
inputs = ["v", "w"]
outputs = ["x.pos", "y.pos", "heading.pos"]
parameters = ["joint.heading.damping"]
tables = {places}

[[source]]
name = "command"
match = "*command*"
time = {{ column = "t", unit = "s" }}
slack = "1 s"
timeout = "3 s"

[source.channels]
v = {{ column = "v", unit = "m/s" }}
w = {{ column = "w", unit = "rad/s" }}

[[array]]
name = "scan"
match = "*scan*"
shape = [{beams}]
column = "ranges"
time = {{ column = "t", unit = "s" }}

[perception]
scan = "scan"
start = "{start} deg"
step = "{step} deg"
longest = {longest}
pose = ["x.pos", "y.pos", "heading.pos"]
slack = "1 s"
timeout = "3 s"
tables = {places}

[arbiter]
use = "tolerance"
tolerance = "3 cm"
tolerance_angle = "0.03 rad"

[prediction]
horizon = "2 s"

[anomaly]
requirement = "8 cm"
outputs = ["x.pos", "y.pos"]
window = "40 s"
"""


class Push(NamedTuple):
    """The robot was driven at a table."""

    table: int
    first: int
    """Row from which on it was driven ahead."""
    last: int
    """At which it had stood for a while."""


class Drive(NamedTuple):
    """What was recorded, and what was so."""

    t: np.ndarray
    """[s]"""
    told: np.ndarray
    """Speed [m/s] and turn rate [rad/s] from each row on, (n, 2)."""
    ranges: np.ndarray
    step: float
    """From beam to beam [°]."""
    longest: float
    pose: np.ndarray
    """True, in the hall (n, 3)."""
    before: np.ndarray
    """Tables (k, 6) at first."""
    after: np.ndarray
    """In the end; the same rows."""
    moved: int
    """Row of the table that was moved; -1: none."""
    when: int
    """Row from which on it stands elsewhere."""
    pushes: tuple[Push, ...]

    def until(self, row: int) -> Drive:
        """Its beginning, ``row`` included."""
        n = row + 1
        return self._replace(t=self.t[:n], told=self.told[:n], ranges=self.ranges[:n])


class _Machine:
    """The robot among what stands there."""

    def __init__(self, pose: np.ndarray, rounds: list[np.ndarray]) -> None:
        self.models = [
            mujoco.MjModel.from_xml_string(
                CART.format(
                    around="".join(
                        f'<geom type="cylinder" pos="{x} {y} 0.35" size="{r} 0.35"/>'
                        for x, y, r in one
                    ),
                    mass=35,
                    x=0,
                    y=0,
                    turn=0,
                )
            )
            for one in rounds
        ]
        self.data = mujoco.MjData(self.models[0])
        self.data.qpos[:] = pose

    def goes(self, told: np.ndarray, dt: float, which: int) -> np.ndarray:
        """Pose after so long in the room before or after."""
        model = self.models[which]
        self.data.ctrl[:] = 0.98 * told[0], 0.0, told[1]
        mujoco.mj_step(model, self.data, round(dt / STEP))
        return np.array(self.data.qpos)


def _turn(pose: np.ndarray, goal: np.ndarray) -> float:
    """From where the robot looks to a place [rad]."""
    off = between(pose, np.array([*goal, 0.0]))
    return float(np.arctan2(off[1], off[0]))


def _towards(pose: np.ndarray, goal: np.ndarray, speed: float) -> np.ndarray:
    """Speeds that lead to a place."""
    turn = _turn(pose, goal)
    return np.array([speed * max(np.cos(turn), 0.0) ** 2, np.clip(2.0 * turn, -1.0, 1.0)])


def _reached(pose: np.ndarray, tables: np.ndarray, standing: np.ndarray) -> list[Any]:
    """Legs that can be driven at straight on: of which table, where, how far."""
    found, others = [], standing[:, :2] - pose[:2]
    if (np.hypot(*others.T) < RADIUS + standing[:, 2] + 0.1).any():
        return []
    for k, table in enumerate(tables):
        for leg in legs(table):
            off = leg[:2] - pose[:2]
            far = float(np.hypot(*off))
            along = off / far
            ahead, aside = others @ along, np.abs(others @ np.array([-along[1], along[0]]))
            same = np.hypot(*(standing[:, :2] - leg[:2]).T) < 1e-6
            barred = (aside < RADIUS + standing[:, 2] + 0.12) & ~same
            barred &= (ahead > -0.3) & (ahead < far + 0.1)
            if NEAREST < far < FARTHEST and not barred.any():
                found.append((k, leg[:2], far))
    return found


class _Driver:
    """Goes round the lane; after a while at each table that it can reach straight on."""

    def __init__(self, way: np.ndarray, dt: float, speed: float, late: int) -> None:
        self.way, self.dt, self.speed, self.late = way, dt, speed, late
        self.at = 0
        """Place on the way."""
        self.pushes: list[Push] = []
        self._plan: list[list[Any]] = []
        self._begun = -1

    @property
    def arrived(self) -> bool:
        return self.at >= len(self.way) - AHEAD - 1 and not self._plan

    def told(self, row: int, pose: np.ndarray, tables: np.ndarray, standing: np.ndarray) -> Any:
        """Speed and turn rate."""
        if not self._plan and self.at > self.late:
            known = {one.table for one in self.pushes}
            fresh = [one for one in _reached(pose, tables, standing) if one[0] not in known]
            if fresh:
                table, leg, far = min(fresh, key=lambda one: one[2])
                rows = (far - RADIUS) / SPEED / self.dt
                self._plan = [["turn", leg, round(5.0 / self.dt)],
                              ["push", table, round(rows + 1.5 / self.dt)],
                              ["back", table, round(rows)]]  # fmt: skip
        if self._plan:
            return self._manoeuvre(row, pose)
        last = len(self.way) - AHEAD - 1
        while self.at < last and np.hypot(*(self.way[self.at + AHEAD, :2] - pose[:2])) < 0.6:
            self.at += 1
        return _towards(pose, self.way[self.at + AHEAD, :2], self.speed)

    def _manoeuvre(self, row: int, pose: np.ndarray) -> Any:
        what, which, left = self._plan[0]
        told = np.array([-SPEED if what == "back" else SPEED, 0.0])
        if what == "turn":
            turn = _turn(pose, which)
            told = np.array([0.0, np.clip(2 * turn, -1, 1)])
            left = 1 if abs(turn) < 0.01 else left
        elif self._begun < 0:
            self._begun = row
        self._plan[0][2] = left - 1
        if left <= 1:
            self._plan.pop(0)
            if what == "push":
                self.pushes.append(Push(which, self._begun, row + 1))
            self._begun = -1
        return told


def _moved(place: Hall, taken: list, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """The tables after one was moved, and which; −1: there is no room."""
    after, k = place.tables.copy(), int(rng.integers(len(place.tables)))
    reach = 0.5 * float(np.hypot(*after[k, 3:5]))
    try:
        after[k, :2] = free_place(rng, place.size, reach, taken)
    except ValueError:
        return after, -1
    after[k, 2] = rng.uniform(-np.pi / 2, np.pi / 2)
    return after, k


def driven(seed: int, tables: int | None = None, move: bool = True, beams: int | None = None,
           rate: float | None = None, laps: float = 2.1) -> Drive:  # fmt: skip
    """A drive, drawn by seed: rounds, and a drive at each table that the way allows."""
    rng = np.random.default_rng([seed, 11])
    place, taken = hall(seed, int(rng.integers(1, 4 if move else 6)) if tables is None else tables)
    wide = [one for one in LIDARS if beams is None or one[0] == beams]
    count, step, longest = wide[int(rng.integers(len(wide)))]
    drawn, speed = float(rng.choice([2.5, 5.0, 10.0])), float(rng.uniform(0.3, 0.5))
    rate = rate or drawn
    way = lane(place.size, speed, 5.0, laps)
    one_lap = int(len(way) / laps)
    after, moved = _moved(place, taken, rng) if move else (place.tables.copy(), -1)
    when = int(rng.uniform(1.05, 1.3) * one_lap)
    standing = [
        np.concatenate([place.rounds, *(legs(one) for one in some)])
        for some in (place.tables, after)
    ]
    machine = _Machine(way[0], standing)
    driver = _Driver(way, 1 / rate, speed, one_lap)
    poses, told, pose, first = list[np.ndarray](), list[np.ndarray](), way[0], None
    while not driver.arrived:
        # nobody moves a table that the robot is driven at
        if first is None and driver.at >= when and not driver._plan:
            first = len(poses)
        which = int(first is not None)
        there = (place.tables, after)[which]
        poses.append(pose)
        told.append(driver.told(len(told), pose, there, standing[which]))
        pose = machine.goes(told[-1], driver.dt, which)
    first = len(poses) if first is None else first
    t = np.arange(len(poses)) / rate
    walkers = people(rng, place.size, int(rng.integers(0, 3)), t)
    angles = np.radians(step) * (np.arange(count) - 0.5 * (count - 1))
    seen = np.zeros((len(poses), count))
    for j, one in enumerate(poses):
        rounds = np.concatenate([standing[int(j >= first)], walkers[j]])
        seen[j] = np.minimum(ranges(place.walls, one, angles), met(rounds, one, angles))
    seen += rng.uniform(0.005, 0.015) * rng.normal(size=seen.shape)
    seen[~(seen < longest)] = np.nan
    return Drive(t, np.array(told), seen, step, longest, np.array(poses), place.tables, after,
                 moved, first, tuple(driver.pushes))  # fmt: skip


def written(drive: Drive, folder: Path, tables: int = 8) -> list[Path]:
    """Twin file, model and recording."""
    folder.mkdir(parents=True, exist_ok=True)
    beams = drive.ranges.shape[1]
    (folder / "cart.xml").write_text(CART.format(around="", mass=20, x=0, y=0, turn=0))
    for name, places in (("cart", tables), ("bare", 0)):
        (folder / f"{name}.toml").write_text(
            TWIN.format(
                places=places,
                start=-0.5 * drive.step * (beams - 1),
                step=drive.step,
                beams=beams,
                longest=drive.longest,
            )
        )
    lines = ["t,v,w", *(f"{t:.3f},{v:.6f},{w:.6f}" for t, (v, w) in zip(drive.t, drive.told))]
    (folder / "run-command.csv").write_text("\n".join([*lines, ""]))
    head = ",".join(["t", *(f"ranges.{k + 1}" for k in range(beams))])
    lines = [head]
    for t, row in zip(drive.t, np.nan_to_num(drive.ranges, nan=2 * drive.longest)):
        lines.append(f"{t:.3f}," + ",".join(f"{v:.3f}" for v in row))
    (folder / "run-scan.csv").write_text("\n".join([*lines, ""]))
    return [folder / "run-command.csv", folder / "run-scan.csv"]
