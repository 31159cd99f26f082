"""Torques in each other's column are told before any number of the arm is known."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import ModelSpec
from evertwin.doctor import Diagnosis
from evertwin.machines.arm import Arm
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from planted.draws import first_of

N, DT = 2000, 0.01


def recording(seed: int, noise: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Motion, (N, 18), and torques, (N, 6), of an arm with a friction of its own."""
    rng, arm = np.random.default_rng(seed), Arm.of("ur5_like", "tanh")
    t = DT * np.arange(N)[:, None, None]
    size, w = rng.uniform(0.05, 0.3, (6, 3)), rng.uniform(0.8, 4.0, (6, 3))
    phase = w * t + rng.uniform(0.0, 6.0, (6, 3))
    parts = (size * np.sin(phase), size * w * np.cos(phase), -size * w * w * np.sin(phase))
    u = np.concatenate([part.sum(axis=2) for part in parts], axis=1)
    friction = {f"{name}{k}": rng.uniform(1.0, 8.0) for name in ("Fv", "Fc") for k in range(1, 7)}
    p = arm.parameters.with_values(friction).values
    tau = arm.simulate(np.zeros(0), u, np.full(N, DT), p)[1]
    return u, tau + rng.normal(0.0, noise, (N, 6))


def examined(seed: int, crossed: tuple[int, int] | None = None) -> Diagnosis:
    """An arm of which the twin knows the bodies, and no friction."""
    (u, tau), arm = recording(seed), Arm.of("ur5_like", "tanh")
    if crossed:
        tau[:, list(crossed)] = tau[:, list(crossed[::-1])]
    columns = zip(arm.inputs.names + arm.outputs.names, np.hstack([u, tau]).T, strict=True)
    options = {"urdf": "ur5_like", "law": "tanh"}
    with Twin(TwinSpec("arm", ModelSpec("arm", options))) as twin:
        return twin.doctor({"t": DT * np.arange(N)} | dict(columns))


@first_of(("seed", "pair"), list(enumerate(combinations(range(6), 2), 20)))
def test_crossed_currents_of_unlike_motors_are_named(
    seed: int, pair: tuple[int, int], tmp_path: Path
) -> None:
    """Each column is read by the constant of the motor that it is not of."""
    (u, tau), arm = recording(seed), Arm.of("ur5_like", "tanh")
    constants = np.random.default_rng(seed).uniform(0.2, 20.0, 6)
    current = tau / constants
    current[:, list(pair)] = current[:, list(pair[::-1])]
    names, units = arm.inputs.names + arm.outputs.names, arm.inputs.units + arm.outputs.units
    scales = [1.0] * len(arm.inputs.names) + constants.tolist()
    channels = {
        name: ChannelSpec(name, unit=unit, scale=scale)
        for name, unit, scale in zip(names, units, scales, strict=True)
    }
    path, rows = tmp_path / "log.csv", np.column_stack([DT * np.arange(N), u, current])
    np.savetxt(path, rows, delimiter=",", header=",".join(["t", *names]), comments="")
    log = SourceSpec("log", time=TimeSpec(column="t", unit="s"), channels=channels)
    spec = TwinSpec("arm", ModelSpec("arm", {"urdf": "ur5_like", "law": "tanh"}), source=(log,))
    with Twin(spec) as twin:
        (found,) = (one for one in twin.doctor(path).findings if one.kind == "exchanged")
    assert f"tau{pair[0] + 1} and tau{pair[1] + 1} look exchanged" in found.reason


@first_of(("seed", "pair"), list(enumerate(combinations(range(6), 2))))
def test_crossed_torques_are_named(seed: int, pair: tuple[int, int]) -> None:
    (found,) = (one for one in examined(seed, pair).findings if one.kind == "exchanged")
    assert f"tau{pair[0] + 1} and tau{pair[1] + 1} look exchanged" in found.reason


@pytest.mark.parametrize("seed", [1, 2])
def test_sound_torques_are_not(seed: int) -> None:
    assert not [one for one in examined(seed).findings if one.kind == "exchanged"]
