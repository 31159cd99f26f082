"""A 6-axis arm that welds a circle, in MuJoCo; its joint friction is not known to its twin.

The arm follows a circle of 40 cm with its torch tilted and yawing, two turns in 69 s, under a
computed-torque controller at 1 kHz. Recorded at 10 Hz are joint angle, speed and acceleration and
the motor torque with sensor noise, one file a cycle.

    python -m evertwin.worlds.arm --urdf ARM.urdf --cycles 3 --seed 1 --out cycles/
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from evertwin.types import StateVector, Vector
from evertwin.worlds.save import save

_STEP = 0.001


@dataclass(frozen=True)
class Truth:
    """What the twin has to find out; one entry per axis.

    >>> len(Truth().coulomb)
    6
    """

    coulomb: tuple[float, ...] = (12.0, 14.0, 10.0, 3.0, 3.0, 2.5)
    """Coulomb friction [Nm]."""
    viscous: tuple[float, ...] = (10.0, 10.0, 8.0, 2.0, 2.0, 2.0)
    """Viscous friction [Nms/rad]."""
    rotor: tuple[float, ...] = (1.5, 1.5, 1.2, 0.3, 0.3, 0.3)
    """Rotor inertia, seen from the joint [kgm²]."""
    noise: tuple[float, ...] = (0.5, 0.8, 0.5, 0.08, 0.08, 0.06)
    """White noise of the measured torque [Nm]."""
    width: float = 0.02
    """Speed at which Coulomb friction has reached tanh 1 of its value [rad/s]."""
    stribeck: float = 0.0
    """Extra share of Coulomb friction at standstill, fading with (q̇ / 0.1)²."""
    payload: float = 0.0
    """Mass in the origin of the tool's frame [kg]."""


@dataclass(frozen=True)
class Cycle:
    """The welding task.

    >>> Cycle().turns
    2
    """

    seconds: float = 69.0
    turns: int = 2
    diameter: float = 0.4
    """[m]"""
    centre: tuple[float, float, float] = (0.4, 0.1, 0.3)
    tilt: float = np.deg2rad(20.0)
    """Torch against the vertical [rad]."""
    yaw: float = 0.5
    """Amplitude of the torch's yaw [rad]."""
    ramp: float = 2.0
    """Time to start and to stop [s]."""


def _progress(cycle: Cycle, t: Vector) -> Vector:
    """Share of the path at increasing times ``t``: smooth start and stop, else constant speed."""

    def eased(s: Vector) -> Vector:
        s = np.clip(s, 0.0, 1.0)
        return np.asarray(s * s * (3.0 - 2.0 * s))

    speed = eased(t / cycle.ramp) * eased((cycle.seconds - t) / cycle.ramp)
    share: Any = cumulative_trapezoid(speed, t, initial=0)
    return np.asarray(share / share[-1])


def path(cycle: Cycle, t: Vector) -> tuple[np.ndarray, np.ndarray]:
    """Torch positions [m] (n, 3) and orientations (n, 3, 3): z of the tool points down, tilted."""
    angle = 2 * np.pi * cycle.turns * _progress(cycle, t)
    radius = cycle.diameter / 2
    place = np.array(cycle.centre) + radius * np.stack(
        [np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1
    )
    yaw = -cycle.yaw * np.sin(angle)
    down = np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])
    c, s = np.cos(cycle.tilt), np.sin(cycle.tilt)
    tilt = np.array([[c, 0, s], [0, 1.0, 0], [-s, 0, c]])
    turn = np.zeros((len(t), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(yaw)
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = -np.sin(yaw), np.sin(yaw), 1.0
    return place, turn @ tilt @ down


def solve_path(model: Any, cycle: Cycle, t: Vector, start: StateVector) -> np.ndarray:
    """Joint angles along the path by damped least squares, (n, nq) [rad]."""
    data = mujoco.MjData(model)
    places, turns = path(cycle, t)
    body = model.nbody - 1
    q = np.empty((len(t), model.nq))
    data.qpos[:] = start
    jacobian = np.zeros((6, model.nv))
    for i in range(len(t)):
        for _ in range(200 if i == 0 else 4):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            now = data.xmat[body].reshape(3, 3)
            error = np.r_[places[i] - data.xpos[body], _rotation(turns[i] @ now.T)]
            if np.linalg.norm(error) < 1e-10:
                break
            mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], body)
            damped = jacobian @ jacobian.T + 1e-8 * np.eye(6)
            data.qpos[:] += jacobian.T @ np.linalg.solve(damped, error)
        if i == 0:
            data.qpos[:] = (data.qpos + np.pi) % (2 * np.pi) - np.pi
        q[i] = data.qpos
    return q


def _rotation(matrix: np.ndarray) -> Vector:
    """Rotation vector of a matrix [rad]."""
    quaternion, vector = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(matrix).ravel())
    mujoco.mju_quat2Vel(vector, quaternion, 1.0)
    return vector


def _friction(truth: Truth) -> Callable[[Vector], Vector]:
    coulomb, viscous = np.array(truth.coulomb), np.array(truth.viscous)

    def at(speed: Vector) -> Vector:
        bump = 1.0 + truth.stribeck * np.exp(-((speed / 0.1) ** 2))
        return np.asarray(coulomb * bump * np.tanh(speed / truth.width) + viscous * speed)

    return at


def planned(model: Any, cycle: Cycle) -> CubicSpline:
    """Joint angles over time [rad] that follow the path.

    The search for the first of them is so sensitive that another payload, which should not matter,
    lets it end in another posture: machines that shall move alike get one plan.
    """
    coarse = np.arange(0.0, cycle.seconds + 0.02, 0.01)
    joints = solve_path(model, cycle, coarse, np.array([0.0, -1.2, 1.8, -2.1, -1.57, 0.0]))
    return CubicSpline(coarse, joints)


def record(
    model: Any, cycle: Cycle, truth: Truth, plan: CubicSpline | None = None
) -> dict[str, np.ndarray]:
    """One cycle: t (n,) [s], q, qd, qdd (n, 6), motor torque tau (n, 6) [Nm], without noise.

    ``plan`` holds the joint angles over time; absent: `planned` for this model and cycle.
    """
    plan = planned(model, cycle) if plan is None else plan
    t = np.arange(round(cycle.seconds / _STEP)) * _STEP
    data, rubs = mujoco.MjData(model), _friction(truth)
    q, qd, inertia = data.qpos, data.qvel, np.zeros((model.nv, model.nv))
    q[:], qd[:] = plan(0.0), plan(0.0, 1)
    rows: list[np.ndarray] = []
    for k, (place, speed, pull) in enumerate(zip(plan(t), plan(t, 1), plan(t, 2), strict=True)):
        aim = pull + 400.0 * (place - q) + 40.0 * (speed - qd)
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, inertia)
        friction = rubs(qd)
        motor = inertia @ aim + data.qfrc_bias + friction
        data.qfrc_applied[:] = motor - friction
        mujoco.mj_forwardSkip(model, data, mujoco.mjtStage.mjSTAGE_VEL, 1)  # it moves alike
        if k % 100 == 0:
            rows.append(np.r_[q, qd, data.qacc, motor])
        mujoco.mj_Euler(model, data)
    table = np.array(rows).reshape(-1, 4, model.nv)
    names = ("q", "qd", "qdd", "tau")
    return {"t": np.arange(len(table)) * 0.1} | {n: table[:, i] for i, n in enumerate(names)}


def load(urdf: Path, truth: Truth) -> Any:
    """The arm in MuJoCo: rigid bodies, rotor inertia as armature, payload; no friction yet."""
    text = urdf.read_text()
    head = text.index(">", text.index("<robot")) + 1
    extension = (
        '<mujoco><compiler fusestatic="false" discardvisual="true" strippath="true"/></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text[:head] + extension + text[head:])
    model.opt.timestep, model.opt.disableflags = _STEP, int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model.dof_armature[:] = truth.rotor
    if truth.payload:
        model.body_mass[-1], model.body_ipos[-1] = truth.payload, 0.0  # the tool itself has no mass
        mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


_NAMES = {"q": "rad", "qd": "rad/s", "qdd": "rad/s^2", "tau": "Nm"}


def columns(
    table: dict[str, np.ndarray], truth: Truth, rng: np.random.Generator
) -> tuple[dict[str, Vector], dict[str, str]]:
    """Columns and units of one recording; noise is added to the torque."""
    noisy = dict(table)
    noisy["tau"] = table["tau"] + np.array(truth.noise) * rng.standard_normal(table["tau"].shape)
    flat = {"t": table["t"]}
    units: dict[str, str] = {}
    for name, unit in _NAMES.items():
        for axis in range(table["tau"].shape[1]):
            flat[f"{name}{axis + 1}"] = noisy[name][:, axis]
            units[f"{name}{axis + 1}"] = unit
    return flat, units


def main(arguments: list[str] | None = None) -> None:
    """Writes cycles into a folder; the motion is one, the noise differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--urdf", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cycles", type=int, default=1)
    parser.add_argument("--growth", type=float, default=0.0, help="friction growth per cycle")
    parser.add_argument("--stribeck", type=float, default=0.0)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    table: dict[str, np.ndarray] | None = None
    for k in range(given.cycles):
        scale = 1.0 + given.growth * k
        truth = Truth(coulomb=tuple(scale * c for c in Truth().coulomb), stribeck=given.stribeck)
        if table is None or given.growth:
            table = record(load(given.urdf, truth), Cycle(), truth)
        rng = np.random.default_rng([given.seed, k])
        flat, units = columns(table, truth, rng)
        save(given.out / f"cycle-{k:04d}.csv", flat, units)


if __name__ == "__main__":
    main()
