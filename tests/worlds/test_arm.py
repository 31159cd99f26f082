"""The embedded arm's torque is what the twin's model says, given the truth; its path a circle."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np
import pytest

from evertwin.machines.arm import Arm
from evertwin.machines.arm.inertia import NAMES, point
from evertwin.worlds.arm import Cycle, Truth, columns, load, path, planned, record
from planted.worlds import record_arm

URDF = Path(str(files("evertwin.machines").joinpath("data", "ur5_like.urdf")))
SHORT = Cycle(seconds=6.0, turns=1, ramp=1.0)


@cache
def recorded() -> dict[str, np.ndarray]:
    """A short cycle without noise."""
    return record(load(URDF, Truth()), SHORT, Truth())


def torque(truth: Truth, table: dict[str, np.ndarray]) -> np.ndarray:
    """Of the twin's model with the true friction, rotor inertia and payload."""
    arm = Arm.of("ur5_like", law="tanh", width=truth.width, payload=True)
    carried = zip(NAMES, point(truth.payload, np.zeros(3)).tolist(), strict=True)
    p = arm.parameters.with_values({f"payload.{name}": value for name, value in carried}).values
    for axis in range(6):
        for name, value in (("Fc", truth.coulomb), ("Fv", truth.viscous), ("Ia", truth.rotor)):
            p[arm.parameters.index(f"{name}{axis + 1}")] = value[axis]
    u = np.concatenate([table["q"], table["qd"], table["qdd"]], axis=1)
    _, tau = arm.simulate(np.zeros(0), u, np.full(len(u), 0.1), p)
    return np.asarray(tau)


def test_the_noise_free_torque_is_the_models() -> None:
    table = recorded()
    assert len(table["t"]) == 60
    assert np.abs(torque(Truth(), table) - table["tau"]).max() < 1e-9
    half = Truth(coulomb=tuple(0.5 * c for c in Truth().coulomb))
    assert np.abs(torque(half, table) - table["tau"]).max() > 1.0


def test_the_torch_follows_the_circle_tilted() -> None:
    model, table = load(URDF, Truth()), recorded()
    data = mujoco.MjData(model)
    wanted, turns = path(SHORT, np.arange(0.0, 6.0, 0.001))
    for i, q in enumerate(table["q"]):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        assert data.xpos[-1] == pytest.approx(wanted[100 * i], abs=2e-4)
        assert data.xmat[-1].reshape(3, 3) == pytest.approx(turns[100 * i], abs=2e-3)
    reach = np.hypot(wanted[:, 0] - 0.4, wanted[:, 1] - 0.1)
    assert reach == pytest.approx(0.2) and wanted[:, 2] == pytest.approx(0.3)
    assert turns[:, 2, 2] == pytest.approx(-np.cos(SHORT.tilt))


def test_more_friction_at_standstill_shows_at_low_speed_only() -> None:
    sticky = Truth(stribeck=0.5)
    table = record(load(URDF, sticky), SHORT, sticky)
    extra = table["tau"] - torque(Truth(), table)
    speed = table["qd"]
    share = 0.5 * np.exp(-((speed / 0.1) ** 2)) * np.tanh(speed / sticky.width)
    assert extra == pytest.approx(share * np.array(sticky.coulomb), abs=1e-9)


def test_an_arm_with_a_payload_can_follow_the_plan_of_one_without() -> None:
    heavy = Truth(payload=2.0)
    table = record(load(URDF, heavy), SHORT, heavy, planned(load(URDF, Truth()), SHORT))
    assert table["q"] == pytest.approx(recorded()["q"], abs=1e-9)
    assert np.abs(torque(heavy, table) - table["tau"]).max() < 1e-9
    assert np.abs(torque(Truth(), table) - table["tau"]).max() > 5.0


def test_noise_is_seeded_and_as_strong_as_told() -> None:
    long = {name: np.repeat(value, 100, axis=0) for name, value in recorded().items()}
    one, again, other = (
        columns(long, Truth(), np.random.default_rng(seed))[0] for seed in (1, 1, 2)
    )
    assert all(np.array_equal(one[name], again[name]) for name in one)
    assert not np.array_equal(one["tau1"], other["tau1"])
    for axis, sigma in enumerate(Truth().noise):
        error = one[f"tau{axis + 1}"] - long["tau"][:, axis]
        assert np.std(error) == pytest.approx(sigma, rel=0.05)
        assert np.array_equal(one[f"q{axis + 1}"], long["q"][:, axis])


def test_the_process_writes_cycles_of_one_motion(tmp_path: Path) -> None:
    record_arm(tmp_path, "--cycles", "2", "--seed", "3")
    first, second = (
        np.genfromtxt(tmp_path / f"cycle-000{k}.csv", delimiter=",", names=True) for k in (0, 1)
    )
    names = first.dtype.names or ()
    assert len(first) == 690 and len(names) == 25
    moved = [name for name in names if not np.array_equal(first[name], second[name])]
    assert [name.split("_")[0] for name in moved] == [f"tau{axis}" for axis in range(1, 7)]
