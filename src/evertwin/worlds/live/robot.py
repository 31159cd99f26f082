"""The transport robot that drives rounds in a hall: commands, and the pose that came of them.

The base of `evertwin.worlds.robot` with the drive of one of its worlds. After three seconds of
standing it sweeps over all speeds, then is sent at random ones; a planner that sees its own speed
steers it round a circle. Once a second of its clock it tells the command [cm/s, rad/s] and the pose
[cm, rad]. It can slip, meet another floor, be pushed, and its drive can change.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np

from evertwin.types import Vector
from evertwin.worlds.drive import WORLDS, Drive, commands, sweep, target
from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.hall import SCENE
from evertwin.worlds.live.orders import Knob, Knobs
from evertwin.worlds.live.sensors import Sensors, faults
from evertwin.worlds.robot import servo

ROUND = 2.5
"""Radius of the rounds [m]."""
SWEEP = 5
"""Seconds of the sweep at each whole speed."""
STILL = 3
GRAVITY = 9.81
POSE = ("x", "y", "heading")


def knobs_of(drive: Drive) -> dict[str, Knob]:
    """What the robot with this drive can be told."""
    return {
        "slip": Knob("share of the wheels' speed that the floor does not take", 0.0, 0.9),
        "floor": Knob("rolling resistance, as a share of the weight", 0.0, 0.2),
        "lag": Knob("time constant of the drive [s]", 0.02, 2.0, drive.lag),
        "start": Knob("speed below which the drive does not do as told [cm/s]",
                      0.0, 15.0, drive.start),
        "cap": Knob("highest speed of the drive [cm/s]", 1.0, 50.0, drive.cap),
        "push": Knob("force from outside, forward [N]", -500.0, 500.0, lasts=0.3),
        **faults(POSE),
    }  # fmt: skip


class LiveRobot:
    """The robot with the drive of a ``world``; ``seed``: of commands and noise.

    >>> robot = LiveRobot("w3", seed=1)
    >>> [(one.topic, one.seq, one.t) for _ in range(2) for one in robot.advance()]
    [('command', 0, 0.0), ('pose', 0, 0.0), ('command', 1, 1.0), ('pose', 1, 1.0)]
    """

    name = "robot"
    units: Mapping[str, Mapping[str, str]] = {
        "command": {"v": "cm/s", "w": "rad/s"},
        "pose": {"x": "cm", "y": "cm", "heading": "rad"},
    }

    def __init__(self, world: str, seed: int, cables: Mapping[str, Knob] | None = None) -> None:
        self._drive, self._how = WORLDS[world]
        self.knobs = Knobs(knobs_of(self._drive) | dict(cables or {}))
        self._rng = np.random.default_rng(seed)
        self._sensors = Sensors(self.knobs)
        self._commands = np.r_[np.zeros(STILL), sweep(self._how, SWEEP)]
        self._model = mujoco.MjModel.from_xml_string(SCENE)
        self._data = mujoco.MjData(self._model)
        self._second = 0

    @property
    def clock(self) -> float:
        """Seconds since it was switched on."""
        return float(self._second)

    def advance(self) -> list[Sample]:
        """What it is told and where it is; then it drives for a second."""
        seq, t = self._second, self.clock
        self.knobs.tick(t)
        speed, turn = self._command(), self._steer()
        told = Sample("command", t, seq, {"v": speed, "w": turn})
        pose = Sample("pose", t, seq, self._sensors.give(self._pose()))
        self._go(speed, turn)
        self._second += 1
        return [told, pose]

    def _command(self) -> float:
        if self._second == len(self._commands):
            more = commands(self._rng, self._how, 100)
            self._commands = np.r_[self._commands, more]
        return float(self._commands[self._second])

    def _steer(self) -> float:
        """Turn rate that keeps it on its round [rad/s]; what stands does not turn."""
        x, y, heading = self._data.qpos
        speed = float(np.hypot(self._data.qvel[0], self._data.qvel[1]))
        if speed < 0.01:
            return 0.0
        away = np.hypot(x, y - ROUND) - ROUND
        along = np.arctan2(y - ROUND, x) + np.pi / 2 + np.clip(away, -0.5, 0.5)
        off = (along - heading + np.pi) % (2 * np.pi) - np.pi
        return float(np.clip(speed / ROUND + 0.1 * off, -0.15, 0.15))

    def _pose(self) -> dict[str, float]:
        rng, sensor = self._rng, self._drive.sensor
        x, y, heading = self._data.qpos
        noise: Vector = rng.standard_normal(3) * (sensor, sensor, 0.001)
        return {
            "x": float(100.0 * x + noise[0]), "y": float(100.0 * y + noise[1]),
            "heading": float((heading + noise[2] + np.pi) % (2 * np.pi) - np.pi),
        }  # fmt: skip

    def _go(self, speed: float, turn: float) -> None:
        """One second under a command."""
        knobs, data, model = self.knobs, self._data, self._model
        drive = replace(
            self._drive, lag=knobs.of("lag"), start=knobs.of("start"), cap=knobs.of("cap")
        )
        aim = float(target(drive, np.array([speed]))[0]) / 100.0 * (1.0 - knobs.of("slip"))
        weight = GRAVITY * model.body_mass[1]
        for k in range(round(1.0 / model.opt.timestep)):
            knobs.tick(self._second + k * model.opt.timestep)
            servo(data, model, aim, turn, drive, self._rng)
            along = np.array([np.cos(data.qpos[2]), np.sin(data.qpos[2])])
            resists = knobs.of("floor") * weight * np.tanh(data.qvel[:2] @ along / 0.005)
            data.qfrc_applied[:2] += (knobs.of("push") - resists) * along
            mujoco.mj_step(model, data)
