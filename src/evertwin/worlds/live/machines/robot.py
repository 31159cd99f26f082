"""The transport robot that drives rounds in a hall and says what it is told and what it senses.

The base of `evertwin.worlds.robot` with the drive of one of its worlds. After three seconds of
standing it sweeps over all speeds, then is sent at random ones; a planner that sees its own speed
steers it round a circle. By its own clock it gives

    command   1 Hz   what it is told [cm/s, rad/s]
    pose      1 Hz   where it is [cm, rad], as a camera or a map would say
    odom     10 Hz   speed and way of its wheels, which do not see slip [m/s, rad/s, m, rad]
    imu      10 Hz   its gyro, with a small bias [rad/s]
    scan      2 Hz   its lidar [m]
    camera           what it sees ahead, as often as it is asked to: pictures

It can slip, meet another floor, be pushed or carried elsewhere, people can walk about, scans get
lost, and its drive can change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from evertwin.types import Vector
from evertwin.worlds.camera import traced
from evertwin.worlds.drive import WORLDS, Drive, commands, sweep, target
from evertwin.worlds.eye import LENS, Shot, carried, shot
from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.machines.hall import HALF, MIDDLE, PEOPLE, SCENE, Lidar, People
from evertwin.worlds.live.machines.sensors import Sensors, faults
from evertwin.worlds.live.orders import Knob, Knobs
from evertwin.worlds.looks import drawn
from evertwin.worlds.robot import servo

ROUND = MIDDLE
"""Radius of the rounds, which begin in the origin [m]."""
TICKS = 10
"""Ticks in a second."""
SCAN = 5
"""Ticks from scan to scan."""
SWEEP = 5
"""Seconds of the sweep at each whole speed."""
STILL = 3
GRAVITY = 9.81
POSE = ("x", "y", "heading")
CLEAR = 0.4
"""Room around the place that it is carried to [m]."""
GYRO, WHEELS, BEAM = 0.005, 0.004, 0.01
"""Standard deviations of the gyro [rad/s], the wheels' speed [m/s], a beam [m]."""
DRIFT = 0.002
"""Bias of the gyro [rad/s]."""


def knobs_of(drive: Drive) -> dict[str, Knob]:
    """What the robot with this drive can be told."""
    return {
        "slip": Knob("share of the wheels' speed that the floor does not take", 0.0, 0.9),
        "floor": Knob("rolling resistance, as a share of the weight", 0.0, 0.2),
        "lag": Knob("time constant of the drive [s]", 0.02, 2.0, drive.lag),
        "start": Knob("speed below which the drive does not do as told [cm/s]",
                      0.0, 15.0, drive.start),
        "cap": Knob("highest speed of the drive [cm/s]", 1.0, 50.0, drive.cap),
        "people": Knob("people who walk in the hall", 0.0, PEOPLE),
        "drop": Knob("share of the scans that get lost", 0.0, 1.0),
        "kidnap": Knob("1: it is carried elsewhere, at once", 0.0, 1.0, lasts=0.05),
        "push": Knob("force from outside, forward [N]", -500.0, 500.0, lasts=0.3),
        **faults((*POSE, "gyro")),
    }  # fmt: skip


def wrapped(angle: float) -> float:
    """In −π … π."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


class LiveRobot:
    """The robot with the drive of a ``world``; ``seed``: of commands and noise; ``pictures``: how
    many a second, up to 10.

    >>> robot = LiveRobot("w3", seed=1)
    >>> first = [robot.advance() for _ in range(11)]
    >>> [one.topic for one in first[0]], [one.topic for one in first[1]]
    (['command', 'pose', 'odom', 'imu', 'scan'], ['odom', 'imu'])
    >>> [(one.seq, one.t) for one in first[10]]
    [(1, 1.0), (1, 1.0), (10, 1.0), (10, 1.0), (2, 1.0)]
    """

    name = "robot"
    units: Mapping[str, Mapping[str, str]] = {
        "command": {"v": "cm/s", "w": "rad/s"},
        "pose": {"x": "cm", "y": "cm", "heading": "rad"},
        "odom": {"v": "m/s", "w": "rad/s", "x": "m", "y": "m", "heading": "rad"},
        "imu": {"gyro": "rad/s"},
        "scan": {"ranges": "m"},
    }

    def __init__(
        self, world: str, seed: int, cables: Mapping[str, Knob] | None = None, pictures: float = 0.0
    ) -> None:
        self._drive, self._how = WORLDS[world]
        self.knobs = Knobs(knobs_of(self._drive) | dict(cables or {}))
        self._rng = np.random.default_rng(seed)
        self._sensors = Sensors(self.knobs)
        self._commands = np.r_[np.zeros(STILL), sweep(self._how, SWEEP)]
        self._model = mujoco.MjModel.from_xml_string(SCENE)
        self._data = mujoco.MjData(self._model)
        self._lidar = Lidar(self._model)
        self._others = np.random.default_rng([seed, 1])  # leaves what the robot does as it is
        self._people = People(self._others)
        self._carried = False
        self.shots: list[tuple[float, Shot]] = []
        """Pictures so far, by its clock [s], and what each shows: that it does not say."""
        self._between = max(round(TICKS / pictures), 1) if pictures else 0
        self._eye = np.random.default_rng([seed, 2])
        self._look = drawn(self._model, HALF, self._eye, (0.0, MIDDLE))
        self._tick = 0
        self._told = (0.0, 0.0)
        self._way = np.zeros(3)  # of the wheels: x, y [m], heading [rad]

    @property
    def clock(self) -> float:
        """Seconds since it was switched on."""
        return self._tick / TICKS

    @property
    def _second(self) -> int:
        return self._tick // TICKS

    def advance(self) -> list[Sample]:
        """What there is to say now; then it drives for a tick."""
        tick, t = self._tick, self.clock
        self.knobs.tick(t)
        self._carry()
        said = []
        if tick % TICKS == 0:
            self._told = self._command(), self._steer()
            told = {"v": self._told[0], "w": self._told[1]}
            said.append(Sample("command", t, self._second, told))
            said.append(Sample("pose", t, self._second, self._sensors.give(self._pose())))
        gyro = self._data.qvel[2] + DRIFT + GYRO * self._rng.standard_normal()
        said.append(Sample("odom", t, tick, self._odometry()))
        said.append(Sample("imu", t, tick, self._sensors.give({"gyro": float(gyro)})))
        self._data.mocap_pos[:] = self._people.walk(int(self.knobs.of("people")), 1.0 / TICKS)
        if tick % SCAN == 0 and self._others.random() >= self.knobs.of("drop"):
            said.append(Sample("scan", t, tick // SCAN, {"ranges": self._scan()}))
        if self._between and tick % self._between == 0:
            said.append(Sample("camera", t, tick // self._between, {"image": self._picture()}))
        self._go(*self._told)
        self._tick += 1
        return said

    def _picture(self) -> bytes:
        mujoco.mj_kinematics(self._model, self._data)
        x, y, heading = self._data.qpos
        seen = traced(self._model, self._data, carried(x, y, heading), LENS,
                      int(self._model.body("base").id))  # fmt: skip
        taken = shot(self._model, self._data, seen, self._look, self._eye)
        self.shots.append((self.clock, taken))
        return taken.png

    def _carry(self) -> None:
        """Elsewhere, once an order."""
        carried = bool(self.knobs.of("kidnap"))
        if carried and not self._carried:
            self._data.qpos[2] += self._others.uniform(0.5, 2 * np.pi - 0.5)
            self._data.qvel[:] = 0.0
            free = False
            while not free:  # neither in a cupboard nor in somebody's arms
                self._data.qpos[:2] = self._people.places(1)[0]
                mujoco.mj_kinematics(self._model, self._data)
                free = bool(self._lidar.scan(self._data).min() > CLEAR)
        self._carried = carried

    def _scan(self) -> Sequence[float]:
        mujoco.mj_kinematics(self._model, self._data)
        ranges = self._lidar.scan(self._data)
        noisy = ranges + BEAM * self._rng.standard_normal(len(ranges))
        return [round(float(one), 3) for one in noisy]

    def _odometry(self) -> dict[str, float]:
        """Of the wheels, which turn faster than the base moves where the floor slips."""
        x, y = self._data.qvel[:2]
        along = np.cos(self._data.qpos[2]) * x + np.sin(self._data.qpos[2]) * y
        v = along / (1.0 - self.knobs.of("slip")) + WHEELS * self._rng.standard_normal()
        w = float(self._data.qvel[2] + WHEELS * self._rng.standard_normal())
        heading = self._way[2]
        self._way += np.array([np.cos(heading) * v, np.sin(heading) * v, w]) / TICKS
        x, y = (float(one) for one in self._way[:2])
        return {"v": float(v), "w": w, "x": x, "y": y, "heading": wrapped(self._way[2])}

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
            "heading": wrapped(heading + noise[2]),
        }  # fmt: skip

    def _go(self, speed: float, turn: float) -> None:
        """One tick under a command."""
        knobs, data, model = self.knobs, self._data, self._model
        drive = replace(
            self._drive, lag=knobs.of("lag"), start=knobs.of("start"), cap=knobs.of("cap")
        )
        aim = float(target(drive, np.array([speed]))[0]) / 100.0 * (1.0 - knobs.of("slip"))
        weight = GRAVITY * model.body_mass[1]
        for k in range(round(1.0 / TICKS / model.opt.timestep)):
            knobs.tick(self.clock + k * model.opt.timestep)
            servo(data, model, aim, turn, drive, self._rng)
            along = np.array([np.cos(data.qpos[2]), np.sin(data.qpos[2])])
            resists = knobs.of("floor") * weight * np.tanh(data.qvel[:2] @ along / 0.005)
            data.qfrc_applied[:2] += (knobs.of("push") - resists) * along
            mujoco.mj_step(model, data)
