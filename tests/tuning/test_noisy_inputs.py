"""A form is not judged by rows that an input's noise decides: a right law stays right."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from evertwin.fold import make_block
from evertwin.machines.drive import DriveForce
from evertwin.tuning import Fit, Problem, carried, solve
from evertwin.tuning.form.noisy_inputs import white

SOS = butter(2, 0.1, output="sos")


def axis(seed: int, noise: float, fading: float = 0.0, push: float = 6.0) -> Fit:
    """An axis that moves from point to point, and what its form is held for."""
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(6000)
    points = rng.uniform(0.0, 0.6, 39)
    leg, part = (t // 1.6).astype(int), np.clip((t % 1.6) / 1.2, 0.0, 1.0)
    v = np.diff(points)[leg] * (30 * part**2 - 60 * part**3 + 30 * part**4) / 1.2
    force = 80 * np.gradient(v, t) + 300 * v + np.sign(v) * (120 + fading * np.exp(-v * v / 0.01))
    y = (force + 15 + rng.normal(0.0, push, len(t)))[:, None]
    seen = v + rng.normal(0.0, noise, len(t))
    u = np.stack([seen, np.gradient(seen, t)], axis=1)
    problem = Problem(
        DriveForce(), (make_block(t=(t * 1e9).astype(np.int64), u=u, y=y),),
        ("mass", "Fv", "Fc", "offset"), filter=lambda c: sosfiltfilt(SOS, c, axis=0),
        moving=lambda u: np.abs(u[:, :1]) > max(0.009, 6 * noise), only_moving=True,
    )  # fmt: skip
    return carried(problem, solve(problem))


@pytest.mark.parametrize("noise", [0.0005, 0.002])
@pytest.mark.parametrize("seed", range(4))
def test_a_right_law_holds_under_noise_of_the_speed(seed: int, noise: float) -> None:
    fit = axis(seed, noise)
    assert not any("does not hold" in reason for reason in fit.reasons)
    assert "its form or that noise" in fit.reasons[2]
    low, high = fit.interval("Fc")
    assert high - low < 12


@pytest.mark.parametrize("noise", [0.0, 0.0005, 0.002])
@pytest.mark.parametrize("seed", range(2))
def test_a_wrong_law_is_found_all_the_same(seed: int, noise: float) -> None:
    assert "the form of force does not hold" in axis(seed, noise, fading=60.0).reasons[2]


def test_noise_is_told_from_motion_and_steps() -> None:
    rng, t = np.random.default_rng(0), 0.01 * np.arange(2000)
    smooth, steps = np.sin(5 * t), np.round(t % 3)
    u = np.stack([smooth, steps, smooth + rng.normal(0.0, 0.02, 2000)], axis=1)
    found = white(u, np.ones(2000, dtype=bool))
    assert found[0] < 1e-4
    assert found[1] == 0
    assert found[2] == pytest.approx(0.02, rel=0.15)
