"""The embedded robot does what its truth says, and the same seed gives the same recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evertwin.errors import ModelError
from evertwin.sources import open_recording
from evertwin.worlds import robot
from evertwin.worlds.drive import WORLDS, Commands, Drive, commands, positions, sweep, target
from planted.worlds import record_robot

SWEEP = robot.Plan(still=2, each=5, seconds=0)


@pytest.mark.parametrize("world", sorted(WORLDS))
def test_a_noise_free_drive_settles_on_its_curve(world: str) -> None:
    told, how = WORLDS[world]
    drive = Drive(told.clamp, lag=told.lag, noise=0.0, sensor=0.0)
    u = sweep(how, 20)
    true, measured = positions(np.random.default_rng(0), drive, u)
    assert np.array_equal(true, measured)
    settled = np.diff(true)[19::20]
    assert settled == pytest.approx(target(drive, u[::20]), abs=1e-9)


def test_below_the_start_threshold_one_drive_stands_and_the_other_clamps() -> None:
    u = np.array([0.0, 0.4, 3.0, 6.0, 10.0, 30.0])
    assert target(Drive(clamp=False), u) == pytest.approx([0.0, 0.0, 0.0, 0.0, 9.9, 16.0])
    assert target(Drive(clamp=True), u) == pytest.approx([0.0, 0.0, 6.0, 6.02, 9.9, 16.0])


def test_the_lag_is_integrated_exactly() -> None:
    drive = Drive(clamp=False, lag=0.3, noise=0.0, sensor=0.0)
    true, _ = positions(np.random.default_rng(0), drive, np.array([10.0, 0.0]))
    aim = 9.9
    first = aim * (1.0 - 0.3 * (1.0 - np.exp(-1.0 / 0.3)))
    speed = aim * (1.0 - np.exp(-1.0 / 0.3))
    assert true == pytest.approx([0.0, first, first + speed * 0.3 * (1.0 - np.exp(-1.0 / 0.3))])


@given(seed=st.integers(0, 2**31), n=st.integers(1, 200), whole=st.booleans())
def test_commands_stay_in_range_and_are_held(seed: int, n: int, whole: bool) -> None:
    u = commands(np.random.default_rng(seed), Commands(3, 5, integer=whole), n)
    assert len(u) == n and u.min() >= 0.0 and u.max() <= 20.0
    assert not whole or np.array_equal(u, np.round(u))
    changes = np.flatnonzero(np.diff(u))
    assert (np.diff(changes) >= 3).all()


@pytest.mark.parametrize("world", sorted(WORLDS))
def test_the_light_robot_reproduces_the_curve(world: str) -> None:
    drive, _ = WORLDS[world]
    steps = []
    for seed in range(20):
        table = robot.light(seed, world, SWEEP)
        steps.append(np.diff(table["x"])[2:].reshape(20, 5)[:, 2:].mean(axis=1))
    aim = target(drive, np.arange(1.0, 21.0))
    spread = np.hypot(drive.noise, drive.sensor) / np.sqrt(20 * 3)
    assert np.abs(np.mean(steps, axis=0) - aim).max() < 5 * spread


def test_the_same_seed_gives_the_same_recording_and_another_another() -> None:
    plan = robot.Plan(still=1, each=0, seconds=20)
    for make in (robot.light, robot.simulate):
        one, again, other = (make(seed, "w1", plan) for seed in (3, 3, 4))
        assert all(np.array_equal(one[name], again[name]) for name in one)
        assert not np.array_equal(one["x"], other["x"])


def test_the_base_in_mujoco_settles_on_the_curve_and_turns() -> None:
    drive, _ = WORLDS["w3"]
    table = robot.simulate(1, "w3", SWEEP)
    way = np.hypot(np.diff(table["x"]), np.diff(table["y"]))[2:].reshape(20, 5)[:, 1:].mean(axis=1)
    moving = np.arange(1.0, 21.0) > drive.start
    assert np.abs(way - target(drive, np.arange(1.0, 21.0)))[moving].max() < 0.8
    assert way[~moving].max() < 0.8
    assert 0.1 < np.ptp(table["heading"]) < 1.0


def test_the_process_writes_what_the_function_gives(tmp_path: Path) -> None:
    path = tmp_path / "sub" / "robot.csv"
    words = ("--world", "w2", "--light", "--seed", "7", "--still", "1", "--each", "0")
    record_robot(path, *words, "--seconds", "30")
    told = robot.light(7, "w2", robot.Plan(1, 0, 30))
    columns = _read(path)
    assert set(columns) == {"v_cmd", "x"}
    assert columns["x"] == pytest.approx(told["x"], abs=1e-9)
    assert columns["v_cmd"] == pytest.approx(told["v_cmd"])


def test_many_runs_go_into_a_folder(tmp_path: Path) -> None:
    words = ["--world", "w4", "--light", "--runs", "3", "--seed", "5", "--seconds", "10"]
    robot.main([*words, "--out", str(tmp_path)])
    assert [p.name for p in sorted(tmp_path.iterdir())] == [f"w4-000{k}.npz" for k in (5, 6, 7)]


def test_a_world_that_fails_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"robot stopped with 2: .*invalid choice: 'w9'"):
        record_robot(tmp_path / "robot.csv", "--world", "w9")


def _read(path: Path) -> dict[str, np.ndarray]:
    (table,) = open_recording(path).tables
    names = [column.name for column in table.columns if column.name != "t"]
    values = np.concatenate([rows.values for rows in table.rows(names, None)])
    return dict(zip(names, values.T, strict=True))
