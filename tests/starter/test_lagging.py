"""Torques that were measured behind a low pass: `init` says so, and the twin is compared so."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import scipy

from evertwin import Twin
from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.config.spec import ModelSpec, TwinSpec
from evertwin.types import Float64
from planted.draws import first_of

RATE, SECONDS, FRICTION = 100.0, 40.0, 6.0
HEADS = "J{}_pos [rad]", "J{}_vel [rad/s]", "J{}_torque [Nm]"
SCALES = np.array([12.0, 11.0, 9.0, 7.0, 7.0, 5.0])
"""Nm that an ampere is."""
URDF = Path(str(files("evertwin.machines").joinpath("data", "ur5_like.urdf")))


@cache
def measured(seed: int) -> tuple[Float64[np.ndarray, "n q"], Float64[np.ndarray, "n tau"]]:
    """Motion, and torques, of a drawn run of an arm whose joints rub."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, SECONDS, 1.0 / RATE)
    q, qd, qdd = np.zeros((3, len(t), 6))
    for j in range(6):
        for size, pace in zip(rng.uniform(0.1, 0.4, 3), rng.uniform(0.3, 3.0, 3), strict=True):
            q[:, j] += size * np.sin(pace * t + j)
            qd[:, j] += size * pace * np.cos(pace * t + j)
            qdd[:, j] -= size * pace**2 * np.sin(pace * t + j)
    with Twin(TwinSpec("arm", ModelSpec("arm", {"urdf": str(URDF), "law": "tanh"}))) as twin:
        model = twin.setup.model
    p, motion = model.parameters.values.copy(), np.concatenate([q, qd, qdd], axis=1)
    for j in range(1, 7):
        p[model.parameters.index(f"Fc{j}")] = FRICTION / j
    tau = model.simulate(model.initial(p), motion, np.full(len(t), 1.0 / RATE), p)[1]
    tau += 0.02 * np.sqrt(np.mean(np.square(tau), axis=0)) * rng.normal(size=tau.shape)
    return np.concatenate([q, qd], axis=1), tau


def proposed(
    seed: int, constant: float, path: Path, heads: tuple[str, ...] = HEADS
) -> tuple[Path, Path]:
    """The twin file of a recording whose torques came through a low pass, and the recording;
    ``heads``: of angles, of speeds unless they are not recorded, and of torques."""
    motion, tau = measured(seed)
    if constant > 0.0:
        stay = np.exp(-1.0 / RATE / constant)
        first = stay * tau[:1]
        tau = scipy.signal.lfilter([1.0 - stay], [1.0, -stay], tau, axis=0, zi=first)[0]
    tau = tau / SCALES if "current" in heads[-1] else tau
    motion = motion[:, : 6 * (len(heads) - 1)]
    table = np.column_stack([np.arange(len(tau)) / RATE, motion, tau])
    names = ["time [s]", *(head.format(j) for head in heads for j in range(1, 7))]
    file, out = path / "run.csv", path / "arm.toml"
    np.savetxt(file, table, delimiter=",", header=",".join(names), comments="", fmt="%.6g")
    write_starter([file], out, ("arm", URDF), False, False)
    return out, file


@first_of(("seed", "constant"), [(3, 0.032), (1, 0.02), (2, 0.02), (4, 0.05)])
def test_the_time_constant_of_all_torques_is_found(
    seed: int, constant: float, tmp_path: Path
) -> None:
    rule = read(proposed(seed, constant, tmp_path)[0]).filter
    assert rule is not None
    assert rule.lag == pytest.approx(constant, rel=0.1)
    assert rule.lagged == tuple(f"{name}{j}" for name in ("q", "qd") for j in range(1, 7))


@first_of(("seed", "heads"), [
    (2, (*HEADS[:2], "J{}_current [A]")), (1, (HEADS[0], HEADS[2])),
    (3, (HEADS[0], "J{}_current [A]")),
])  # fmt: skip
def test_so_is_that_of_currents_and_of_arms_without_speeds(
    seed: int, heads: tuple[str, ...], tmp_path: Path
) -> None:
    rule = re.search(r'^lag = "(.*) ms"', proposed(seed, 0.032, tmp_path, heads)[0].read_text(),
                     re.MULTILINE)  # fmt: skip
    assert rule is not None
    assert float(rule[1]) == pytest.approx(32.0, rel=0.15)


@first_of("seed", [1, 2, 3])
def test_noise_of_a_speed_is_no_lag(seed: int, tmp_path: Path) -> None:
    """What is derived from it scatters less behind any low pass."""
    motion, tau = measured(seed)
    noisy = motion.copy()
    noisy[:, 6:] += np.random.default_rng(seed).normal(0.0, 1e-2, noisy[:, 6:].shape)
    names = ["time [s]", *(head.format(j) for head in HEADS for j in range(1, 7))]
    table = np.column_stack([np.arange(len(tau)) / RATE, noisy, tau])
    file, out = tmp_path / "run.csv", tmp_path / "arm.toml"
    np.savetxt(file, table, delimiter=",", header=",".join(names), comments="", fmt="%.6g")
    write_starter([file], out, ("arm", URDF), False, False)
    rule = read(out).filter
    assert rule is not None and not rule.lagged


@first_of("seed", [1, 2, 3])
def test_torques_that_come_at_once_have_none(seed: int, tmp_path: Path) -> None:
    rule = read(proposed(seed, 0.0, tmp_path)[0]).filter
    assert rule is not None and not rule.lagged


@pytest.mark.long
def test_friction_is_not_tuned_to_the_lag(tmp_path: Path) -> None:
    out, file = proposed(1, 0.032, tmp_path)
    with Twin.open(out) as twin:
        fit = twin.fit([file]).fit
    assert [fit[f"Fc{j}"] for j in (1, 2, 3)] == pytest.approx([6.0, 3.0, 2.0], rel=0.05)
