"""A transport robot whose drive is not known to its twin; writes recordings.

Two forms of one machine: ``--light`` integrates the drive of `evertwin.worlds.drive` over seconds,
for experiments by the hundred; otherwise a base with mass and friction moves in MuJoCo under the
same controller, with a heading as well.

    python -m evertwin.worlds.robot --world w3 --seed 1 --out robot.csv
    python -m evertwin.worlds.robot --world w1 --light --runs 200 --out runs/
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.types import Vector
from evertwin.worlds.drive import WORLDS, Commands, Drive, commands, positions, sweep, target
from evertwin.worlds.save import save


@dataclass(frozen=True)
class Plan:
    """What one recording contains: standing, a sweep, random commands.

    >>> Plan().each
    5
    """

    still: int = 3
    """Seconds at standstill first."""
    each: int = 5
    """Seconds of the sweep at each whole speed; 0: no sweep."""
    seconds: int = 400
    """Seconds of random commands after it."""


def _commands(rng: np.random.Generator, how: Commands, plan: Plan) -> Vector:
    first = sweep(how, plan.each) if plan.each else np.zeros(0)
    return np.concatenate([np.zeros(plan.still), first, commands(rng, how, plan.seconds)])


def light(seed: int, world: str, plan: Plan) -> dict[str, Vector]:
    """Columns of one recording: command [cm/s] as it is sent, position [cm], every second."""
    rng = np.random.default_rng(seed)
    drive, how = WORLDS[world]
    u = _commands(rng, how, plan)
    _, measured = positions(rng, drive, u)
    return {"t": np.arange(len(u) + 1) * 1.0, "v_cmd": np.r_[u, u[-1:]], "x": measured}


_SCENE = """
<mujoco><option timestep="0.005" integrator="implicitfast"/>
<worldbody><geom type="plane" size="50 50 .1"/>
<body name="base" pos="0 0 0.1"><joint name="x" type="slide" axis="1 0 0"/>
<joint name="y" type="slide" axis="0 1 0"/><joint name="heading" type="hinge" axis="0 0 1"/>
<geom type="cylinder" size=".2 .1" mass="20" contype="0" conaffinity="0"/></body>
</worldbody></mujoco>
"""


def simulate(seed: int, world: str, plan: Plan) -> dict[str, Vector]:
    """Columns of one recording in MuJoCo: commands [cm/s, rad/s], pose [cm, rad] at 1 Hz.

    The controller settles with the drive's lag; the base turns slowly while it drives, so that the
    pose is truly planar.
    """
    import mujoco

    rng = np.random.default_rng(seed)
    drive, how = WORLDS[world]
    u = _commands(rng, how, plan)
    turn = 0.02 * np.sin(2 * np.pi * np.arange(len(u)) / 60.0)
    model = mujoco.MjModel.from_xml_string(_SCENE)
    data = mujoco.MjData(model)
    aim, poses = target(drive, u) / 100.0, [np.zeros(3)]
    steps = round(1.0 / model.opt.timestep)
    for k in range(len(u)):
        for _ in range(steps):
            servo(data, model, float(aim[k]), float(turn[k]), drive, rng)
            mujoco.mj_step(model, data)
        poses.append(data.qpos.copy())
    pose = np.array(poses)
    pose[:, :2] = pose[:, :2] * 100.0 + drive.sensor * rng.standard_normal((len(pose), 2))
    pose[:, 2] += 0.001 * rng.standard_normal(len(pose))
    return {
        "t": np.arange(len(u) + 1) * 1.0, "v_cmd": np.r_[u, u[-1:]],
        "w_cmd": np.r_[turn, turn[-1:]],
        "x": pose[:, 0], "y": pose[:, 1], "heading": pose[:, 2],
    }  # fmt: skip


def servo(
    data: Any, model: Any, speed: float, turn: float, drive: Drive, rng: np.random.Generator
) -> None:
    """Forces of the speed controller, in the base's frame; settles with the drive's lag."""
    c, s = np.cos(data.qpos[2]), np.sin(data.qpos[2])
    forward, sideways = c * data.qvel[0] + s * data.qvel[1], c * data.qvel[1] - s * data.qvel[0]
    dt, mass, inertia = model.opt.timestep, model.body_mass[1], model.body_inertia[1][2]
    # white noise of the speed such that the displacement spreads by drive.noise per √s
    noise = drive.noise / 100.0 / np.sqrt(dt) * rng.standard_normal() if speed else 0.0
    push = mass * (speed + noise - forward) / drive.lag
    hold = -mass * sideways / drive.lag
    data.qfrc_applied[:] = (
        c * push - s * hold, s * push + c * hold, inertia * (turn - data.qvel[2]) / drive.lag,
    )  # fmt: skip


_UNITS = {"v_cmd": "cm/s", "w_cmd": "rad/s", "x": "cm", "y": "cm", "heading": "rad"}


def main(arguments: list[str] | None = None) -> None:
    """Writes one recording, or ``--runs`` of them into a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", choices=sorted(WORLDS), default="w3")
    parser.add_argument("--light", action="store_true", help="without MuJoCo")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--runs", type=int, default=0, help="recordings, seeds from --seed on")
    parser.add_argument("--still", type=int, default=Plan.still, help="standing seconds first")
    parser.add_argument("--each", type=int, default=Plan.each, help="sweep seconds per speed")
    parser.add_argument("--seconds", type=int, default=Plan.seconds, help="random seconds")
    parser.add_argument("--format", choices=("csv", "npz"), default="npz", help="of many runs")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    make, plan = (light if given.light else simulate), Plan(given.still, given.each, given.seconds)
    for k in range(max(1, given.runs)):
        seed = given.seed + k
        path = given.out / f"{given.world}-{seed:04d}.{given.format}" if given.runs else given.out
        save(path, make(seed, given.world, plan), _UNITS)


if __name__ == "__main__":
    main()
