"""The tool's path error that a twin foretells: `python -m proofs.path_error [DRAWS]`.

Virtual commissioning: how far will the tool be off a path that the machine has not run yet? Here
MuJoCo is the machine. Coulomb friction of every joint is drawn (half to three times what the twin
is configured with), random moves are recorded with noise, and the twin tunes itself on them.
Then a new path is drawn: joints, line, pause, circle, at random speeds and with random controllers.
MuJoCo follows it under the same controllers; `evertwin whatif` foretells how far its tool is off.
Told are the differences, with the values as configured (the dummy) and after tuning, and how often
the 95 % intervals held. Half of the twins are components, half are of ``kind = "arm"``.

Then the same where the twin's law of friction is not the machine's: a Stribeck peak of 30 %.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from multiprocessing import get_context
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
from scipy.interpolate import CubicHermiteSpline

from evertwin import Twin, TwinSpec
from evertwin.ahead.path_error import apart
from evertwin.ahead.simulated import PathError
from evertwin.ahead.spec import PathSpec, ScenarioSpec
from evertwin.config import spec
from evertwin.errors import UsageError
from evertwin.machines.arm import Arm
from evertwin.machines.arm.mjcf import mjcf_of
from evertwin.machines.assembly.kinematics import tool
from evertwin.machines.assembly.path import Limits, Motion, moves_of, plan
from planted.twins import shipped
from proofs._verdict import chance, ended, holds

N, RATE, SETTLE, STEP = 6, 100.0, 1.0, 1e-3
MOVES, SLOW = 180, 10.0
"""Moves of a recording, and its rows a second."""
LONGEST = 30.0
"""Of a path [s]: a tool that creeps past a singular pose is hardly ever off its path."""
ROTOR = np.array([1.5, 1.5, 1.2, 0.3, 0.3, 0.3])
NOISE = np.array([0.5, 0.8, 0.5, 0.08, 0.08, 0.06])
WIDTH, FADE = 0.02, 0.1
FIGURES = ("rms", "largest", "end")
KINDS = ("tool", "tool, off the path")
PROFILES: tuple[Literal["trapezoid", "quintic"], ...] = ("trapezoid", "quintic")


class Truth(NamedTuple):
    """What MuJoCo has and the twin has to find."""

    coulomb: np.ndarray
    viscous: np.ndarray
    stribeck: float = 0.0

    def friction(self, v: np.ndarray) -> np.ndarray:
        """Friction of every joint [Nm]."""
        bump = 1.0 + self.stribeck * np.exp(-((v / FADE) ** 2))
        return np.asarray(self.coulomb * bump * np.tanh(v / WIDTH) + self.viscous * v)


class Control(NamedTuple):
    """Controllers of all axes, counted at the joint."""

    kp: float
    kv: np.ndarray
    """[Nms/rad]"""
    feedforward: float


def engine(arm: Arm, rotor: np.ndarray) -> Any:
    """The arm's bodies in MuJoCo, with the rotors' inertia."""
    model = mujoco.MjModel.from_xml_string(mjcf_of(arm.chain))
    model.opt.timestep, model.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    model.dof_armature[:] = rotor
    return model


def places(model: Any, chain: Any, q: np.ndarray) -> np.ndarray:
    """Where MuJoCo has the tool at joint positions [m], (n, 3)."""
    data, found = mujoco.MjData(model), np.empty((len(q), 3))
    for i, row in enumerate(q):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        turn = data.xmat[-1].reshape(3, 3)
        found[i] = data.xpos[-1] + turn @ chain.tool[:3, 3]
    return found


def recorded(model: Any, motion: Motion, truth: Truth, rng: Any) -> dict[str, np.ndarray]:
    """Torques of a motion by MuJoCo's inverse dynamics, with friction and noise."""
    data, tau = mujoco.MjData(model), np.empty_like(motion.q)
    for i in range(len(motion.t)):
        data.qpos[:], data.qvel[:], data.qacc[:] = motion.q[i], motion.qd[i], motion.qdd[i]
        mujoco.mj_inverse(model, data)
        tau[i] = data.qfrc_inverse
    tau += truth.friction(motion.qd) + NOISE * rng.standard_normal(tau.shape)
    columns = {"q": motion.q, "qd": motion.qd, "qdd": motion.qdd, "tau": tau}
    flat = {f"{k}{j + 1}": x[:, j].copy() for k, x in columns.items() for j in range(N)}
    return {"t": motion.t, **flat}


def travelled(model: Any, motion: Motion, truth: Truth, control: Control) -> np.ndarray:
    """Joint positions in the rows of a path that MuJoCo follows, (n, joints)."""
    data, ends = mujoco.MjData(model), motion.t[-1]
    wanted = CubicHermiteSpline(motion.t, motion.q, motion.qd)
    speed = wanted.derivative()
    # controllers ask once a stage of Runge-Kutta: all set-points beforehand
    grid = np.arange(0.0, SETTLE + ends + 1.0, 0.5 * STEP)
    now = np.clip(grid - SETTLE, 0.0, ends)
    q_set, v_set = (
        wanted(now),
        np.where((grid[:, None] < SETTLE) | (now[:, None] >= ends), 0.0, speed(now)),
    )

    def drive(_: Any, data: Any) -> None:
        k = round(data.time / (0.5 * STEP))
        v = control.kp * (q_set[k] - data.qpos) + control.feedforward * v_set[k]
        data.qfrc_applied[:] = control.kv * (v - data.qvel) - truth.friction(data.qvel)

    data.qpos[:] = motion.q[0]
    found = np.empty_like(motion.q)
    mujoco.set_mjcb_control(drive)
    try:
        every, first = round(1.0 / RATE / STEP), round(SETTLE / STEP)
        for k in range(first + every * (len(motion.t) - 1) + 1):
            if k >= first and (k - first) % every == 0:
                found[(k - first) // every] = data.qpos
            mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_control(None)
    return found


def errors(tips: np.ndarray, planned: np.ndarray) -> dict[str, tuple[float, ...]]:
    """rms, largest and last error [mm], of time and of the path."""
    both = (np.linalg.norm(tips - planned, axis=1), apart(tips, planned))
    return {
        kind: (
            float(np.sqrt(np.mean(size**2))) * 1e3,
            float(size.max()) * 1e3,
            float(size[-1]) * 1e3,
        )
        for kind, size in zip(KINDS, both, strict=True)
    }


def program(rng: Any, chain: Any, start: np.ndarray) -> list[dict[str, Any]]:
    """Joints, line, pause, circle: random, near the start."""
    to = start + rng.uniform(-0.5, 0.5, N)
    frame, _ = tool(chain, to)
    corner = frame[:3, 3] + rng.uniform(-0.15, 0.15, 3)
    centre = corner + np.r_[rng.uniform(0.05, 0.12) * np.array([1.0, 0.0]), 0.0]
    return [
        {"move": "joints", "to": to.tolist()},
        {"move": "line", "to": corner.tolist(), "speed": float(rng.uniform(0.1, 0.5))},
        {"move": "pause", "seconds": 0.3},
        {"move": "circle", "centre": centre.tolist(), "speed": float(rng.uniform(0.1, 0.5))},
    ]


@cache
def twins() -> tuple[TwinSpec, TwinSpec]:
    """The same twin as an arm and as components; Coulomb friction is tuned."""
    own = shipped("arm", source=(), tuning={"editable": ("Fc*",)})
    known = own.model.parameters
    lines: list[dict[str, Any]] = [{"name": "links", "kind": "arm", "urdf": "ur5_like"}]
    values: dict[str, spec.ParameterSpec] = {}
    for j in range(1, N + 1):
        lines.append({"name": f"motor{j}", "kind": "motor", "axis": j})
        lines.append({"name": f"gearbox{j}", "kind": "gearbox", "axis": j, "ratio": 100.0})
        values[f"motor{j}.J"] = spec.ParameterSpec(value=float(ROTOR[j - 1]) / 1e4)
        values |= {f"gearbox{j}.{name}": known[f"{name}{j}"] for name in ("Fc", "Fv")}
    parts = spec.ModelSpec("assembly", {"components": tuple(lines)}, values)
    return own, replace(own, model=parts, tuning=replace(own.tuning, editable=("gearbox*.Fc",)))


class Told(NamedTuple):
    """One draw: MuJoCo's errors, and what both versions foretold."""

    true: Mapping[str, tuple[float, ...]]
    said: tuple[Mapping[str, PathError], ...]
    tuned: bool


def one(seed: int, stribeck: float) -> Told:
    """One machine, its recording, its twin, one new path."""
    rng = np.random.default_rng([seed, 4])
    arm = Arm.of("ur5_like", law="tanh")
    model = engine(arm, ROTOR)
    config = twins()[seed % 2]
    configured = Twin(twins()[0]).model.parameters
    fc, fv = (
        np.array([configured[f"{name}{j}"].value for j in range(1, N + 1)]) for name in ("Fc", "Fv")
    )
    truth = Truth(fc * rng.uniform(0.5, 3.0, N), fv, stribeck)
    start = np.array([0.0, -1.2, 1.6, -0.4, 0.3, 0.0])
    limits = Limits((2.0,) * N, (4.0,) * N)
    goals = [
        {"move": "joints", "to": (start + rng.uniform(-0.8, 0.8, N)).tolist()} for _ in range(MOVES)
    ]
    motion = plan(moves_of(goals), start.tolist(), limits, SLOW, "quintic")
    twin = Twin(config)
    data = recorded(model, motion, truth, rng)
    twin.run(data)
    while True:
        moves = program(rng, arm.chain, start)
        profile = PROFILES[int(rng.integers(2))]
        path = PathSpec(
            moves=tuple(moves), start=tuple(start.tolist()), acceleration=(4.0,) * N,
            speed=(2.0,) * N, rate=RATE, profile=profile,
        )  # fmt: skip
        try:
            new = plan(moves_of(moves), start.tolist(), limits, RATE, profile, arm.chain)
        except UsageError:
            continue  # out of reach: another one
        if new.t[-1] < LONGEST:
            break
    kp, speed = float(rng.uniform(8.0, 30.0)), rng.uniform(60.0, 200.0, N)
    control = Control(kp, speed * (ROTOR + 0.2), float(rng.choice([0.8, 1.0])))
    at_motor = control.kv / (100.0 if seed % 2 else 1.0)
    path = replace(path, controller={
        "kp": kp, "kv": tuple(at_motor.tolist()), "feedforward": control.feedforward,
    })  # fmt: skip
    scenario = ScenarioSpec("new path", path=path)
    said = [one.whatif(scenario, data).after.path_error for one in (Twin(config), twin)]
    rows = travelled(model, new, truth, control)
    planned = places(model, arm.chain, new.q)
    true = errors(places(model, arm.chain, rows), planned)
    return Told(true, tuple(said), twin.champion.number > 0)


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def reported(found: list[Told], label: str) -> tuple[float, float]:
    """Prints how far both versions were off; (median tuned / configured, share in intervals)."""
    say(f"-- {len(found)} machines, {label}; tuned: {sum(one.tuned for one in found)}")
    inside: list[bool] = []
    ratios = []
    for kind in KINDS:
        for k, figure in enumerate(FIGURES):
            true = np.array([one.true[kind][k] for one in found])
            values = np.array([[getattr(v[kind], figure) for v in one.said] for one in found])
            ends = np.array([getattr(one.said[1][kind], f"{figure}95") for one in found])
            off = np.abs(values - true[:, None]) / true[:, None]
            held = (ends[:, 0] <= true) & (true <= ends[:, 1])
            say(
                f"{kind:<19} {figure:<8} MuJoCo {np.median(true):6.3f} mm; foretold off by, as "
                f"configured {_share(off[:, 0])}, tuned {_share(off[:, 1])}; in the 95 % of the "
                f"tuned {int(held.sum())} of {len(found)}"
            )
            inside += held.tolist()
            ratios.append(float(np.median(off[:, 1]) / np.median(off[:, 0])))
    return max(ratios), float(np.mean(inside))


def _share(off: np.ndarray) -> str:
    return f"{100 * np.median(off):5.2f} % (90 % below {100 * np.quantile(off, 0.9):5.2f} %)"


def main() -> int:
    """Exit code 0 if tuning halves the errors of the forecast and the intervals hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("draws", nargs="?", type=int, default=100)
    count = parser.parse_args().draws
    workers = min(os.cpu_count() or 1, 8)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        same = list(pool.map(one, range(count), [0.0] * count))
        other = list(pool.map(one, range(max(count // 5, 1)), [0.3] * (max(count // 5, 1))))
    ratio, held = reported(same, "the twin's law of friction is the machine's")
    reported(other, "the machine's friction has a Stribeck peak of 30 %, the twin's has none")
    return ended({
        "tuning halves what is off": ratio < 0.5,
        "intervals of 95 %": holds(0.95, held, chance(0.95, count)),
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
