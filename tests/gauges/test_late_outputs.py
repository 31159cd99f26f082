"""Torques that come late behind the motion are told as that, not learned as friction."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Block, make_block
from evertwin.gauges.delays.late_outputs import late_outputs
from evertwin.machines.arm import Arm
from evertwin.tuning import Problem, solve
from planted.draws import first_of

N, DT = 3000, 0.01
TUNED = tuple(f"{name}{k}" for k in range(1, 7) for name in ("Fv", "Fc"))


def rows(seed: int, late: int, friction: float = 1.0, noise: float = 0.05) -> tuple[Arm, Block]:
    """An arm as it held, with the torques of ``late`` rows before, and so many times its friction
    on one joint."""
    rng, arm = np.random.default_rng(seed), Arm.of("ur5_like", "tanh")
    t = DT * np.arange(N)[:, None, None]
    size, w = rng.uniform(0.05, 0.2, (6, 3)), rng.uniform(0.8, 4.0, (6, 3))
    phase = w * t + rng.uniform(0.0, 6.0, (6, 3))
    parts = (size * np.sin(phase), size * w * np.cos(phase), -size * w * w * np.sin(phase))
    u = np.concatenate([part.sum(axis=2) for part in parts], axis=1)
    held = arm.parameters.with_values(dict.fromkeys(TUNED, 4.0))
    true = held.with_values({"Fc3": 4.0 * friction, "Fv3": 4.0 * friction})
    y = arm.simulate(np.zeros(0), u, np.full(N, DT), true.values)[1]
    y = np.roll(y, late, axis=0) + noise * rng.normal(size=y.shape)
    stamps = (np.arange(N) * DT * 1e9).astype(np.int64)
    told = arm.of("ur5_like", "tanh")
    object.__setattr__(told, "parameters", held)
    return told, make_block(t=stamps, u=u, y=y)


@first_of(("seed", "late"), [(1, 4), (2, 2), (3, 9), (4, -4), (5, 6)])
def test_a_shift_of_all_outputs_is_told_with_its_size(seed: int, late: int) -> None:
    arm, block = rows(seed, late)
    problem = Problem(arm, (block,), TUNED)
    found = late_outputs(problem, solve(problem))
    assert found is not None and found.channel == ""
    way = "late" if late > 0 else "early"
    assert found.said.startswith(f"all outputs come {10 * abs(late)} ± 10 ms {way}")
    assert "nothing is learned" in found.said


@pytest.mark.parametrize(("seed", "friction"), [(1, 1.0), (2, 1.3), (3, 0.7), (4, 2.0)])
def test_friction_and_noise_are_no_shift(seed: int, friction: float) -> None:
    arm, block = rows(seed, 0, friction, noise=0.5)
    problem = Problem(arm, (block,), TUNED)
    assert late_outputs(problem, solve(problem)) is None
