"""The arm that welds circle after circle: angle, speed and torque, as its controller gives them.

The machine of `evertwin.worlds.arm` at 500 Hz. Its controller computes torques from the plan; it
knows the load, not a push. Ten times a second of its clock it gives angle, speed and torque of each
axis, the number of the cycle and the motors' temperature; no acceleration, as controllers do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np

from evertwin.types import Vector
from evertwin.worlds.arm import Cycle, Truth, load, planned
from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.machines.sensors import Sensors, faults
from evertwin.worlds.live.orders import Knob, Knobs

STEP = 0.002
EVERY = 50
"""Steps from sample to sample."""
AXES = tuple("123456")
SIGNALS = tuple(f"{name}{axis}" for name in ("q", "qd", "tau") for axis in AXES)
NOISE = {"q": 2e-5, "qd": 3e-4}
"""Standard deviations of a measured angle [rad] and speed [rad/s]."""
THINNER = 0.01
"""Share by which friction falls per kelvin of warmer grease."""
WARM = 25.0
"""Temperature at which the truth is told [°C]."""
KNOBS = {
    "payload": Knob("mass at the tool [kg]", 0.0, 15.0),
    "friction": Knob("Coulomb friction of an axis times this", 0.1, 10.0, 1.0, AXES),
    "growth": Knob("Coulomb friction grows by this share a cycle", -0.5, 1.0, 0.0, AXES),
    "temperature": Knob("of the motors [°C]; friction falls by 1 % a kelvin", -20.0, 80.0, WARM),
    "push": Knob("torque from outside on an axis [Nm]", -300.0, 300.0, 0.0, AXES, lasts=0.3),
    **faults(SIGNALS),
}


class LiveArm:
    """The arm. ``urdf``: its description; ``seed``: of the noise.

    >>> from importlib.resources import files
    >>> urdf = Path(str(files("evertwin.machines").joinpath("data", "ur5_like.urdf")))
    >>> arm = LiveArm(urdf, seed=1)
    >>> [(one.seq, round(one.t, 3)) for _ in range(3) for one in arm.advance()]
    [(0, 0.0), (1, 0.1), (2, 0.2)]
    """

    name = "arm"
    units: Mapping[str, Mapping[str, str]] = {
        "state": {
            "cycle": "1",
            **{f"q{axis}": "rad" for axis in AXES},
            **{f"qd{axis}": "rad/s" for axis in AXES},
            **{f"tau{axis}": "Nm" for axis in AXES},
            "temperature": "degC",
        }
    }

    def __init__(self, urdf: Path, seed: int, cables: Mapping[str, Knob] | None = None) -> None:
        self.knobs = Knobs(KNOBS | dict(cables or {}))
        self._truth, self._urdf, self._carried = Truth(), urdf, 0.0
        self._rng = np.random.default_rng(seed)
        self._sensors = Sensors(self.knobs)
        self._model = load(urdf, self._truth)
        cycle = Cycle()
        plan, t = planned(self._model, cycle), np.arange(0.0, cycle.seconds, STEP)
        self._plan = np.stack([plan(t), plan(t, 1), plan(t, 2)], axis=1)
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:], self._data.qvel[:] = self._plan[0, 0], self._plan[0, 1]
        self._model.opt.timestep = STEP
        self._inertia = np.zeros((6, 6))
        self._viscous = np.array(self._truth.viscous)
        self._step = 0
        self._feel()

    @property
    def clock(self) -> float:
        """Seconds since it was switched on."""
        return self._step * STEP

    @property
    def cycle(self) -> int:
        """Number of the cycle, from 0."""
        return self._step // len(self._plan)

    def advance(self) -> list[Sample]:
        """Runs up to the next sample."""
        seq = self._step // EVERY
        t = self.clock
        self.knobs.tick(t)
        self._load()
        self._feel()
        motor = self._move()
        sample = self._sample(t, seq, motor)
        for _ in range(EVERY - 1):
            self._move()
        return [sample]

    def _load(self) -> None:
        """Carries what it is told to, from the next step on."""
        if (mass := self.knobs.of("payload")) == self._carried:
            return
        self._carried = mass
        self._model.body_mass[-1] = mass  # the tool itself has no mass
        self._model.body_ipos[-1] = 0.0
        mujoco.mj_setConst(self._model, mujoco.MjData(self._model))

    def _feel(self) -> None:
        """Friction and push as they are told, until the next sample or cycle."""
        self._dry = np.array(self._truth.coulomb) * np.array(self.knobs.all("friction"))
        self._warm = np.exp(-THINNER * (self.knobs.of("temperature") - WARM))
        self._push = np.array(self.knobs.all("push"))

    def _friction(self, speed: Vector) -> Vector:
        rubs = self._dry * np.tanh(speed / self._truth.width) + self._viscous * speed
        return np.asarray(self._warm * rubs)

    def _move(self) -> Vector:
        """One step; the motors' torque in it [Nm]."""
        at = self._step % len(self._plan)
        if at == 0 and self._step:
            self._wear()
        model, data, (place, speed, acceleration) = self._model, self._data, self._plan[at]
        aim = acceleration + 400.0 * (place - data.qpos) + 40.0 * (speed - data.qvel)
        mujoco.mj_step1(model, data)
        mujoco.mj_fullM(model, data, self._inertia)
        friction = self._friction(data.qvel)
        motor = self._inertia @ aim + data.qfrc_bias + friction
        self._shown = data.qpos.copy(), data.qvel.copy()
        data.qfrc_applied[:] = motor - friction + self._push
        mujoco.mj_step2(model, data)
        self._step += 1
        return np.asarray(motor)

    def _wear(self) -> None:
        for axis in AXES:
            if grown := self.knobs.of("growth", axis):
                self.knobs.set("friction", axis, self.knobs.of("friction", axis) * (1.0 + grown))
        self._feel()

    def _sample(self, t: float, seq: int, motor: Vector) -> Sample:
        rng, (q, qd) = self._rng, self._shown
        noisy = {
            "q": q + NOISE["q"] * rng.standard_normal(6),
            "qd": qd + NOISE["qd"] * rng.standard_normal(6),
            "tau": motor + np.array(self._truth.noise) * rng.standard_normal(6),
        }
        true = {f"{name}{axis}": float(v) for name in noisy for axis, v in zip(AXES, noisy[name])}
        cycle = round(t / STEP) // len(self._plan)
        values: dict[str, float | Sequence[float]] = {"cycle": cycle}
        values |= self._sensors.give(true) | {"temperature": self.knobs.of("temperature")}
        return Sample("state", t, seq, values)
