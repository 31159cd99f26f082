"""Numbers of noisy inputs: their intervals hold, or it is said that nothing can be told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from evertwin.fold import make_block
from evertwin.machines.drive import DriveForce
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.form.blurred import Drawn, blurred

SOS = butter(2, 0.2, output="sos")
TRUTH = {"mass": 20.0, "Fv": 15.0, "Fc": 8.0, "offset": 100.0}


def derived(place: np.ndarray, dt: float) -> np.ndarray:
    speed = np.gradient(place, dt)
    return np.stack([speed, np.gradient(speed, dt)], axis=1)


def fits(seed: int, noise: float, scale: float = 1.0) -> tuple[Fit, Fit]:
    """An axis of which only place and force are recorded: its fit, and that with what noise does.

    Args:
        noise: of the place, beside its way of about a metre.
    """
    rng, dt = np.random.default_rng(seed), 0.02
    t = np.arange(6000) * dt
    w, phase = rng.uniform(0.5, 5.0, 4), rng.uniform(0.0, 6.0, 4)
    place = scale * np.sin(np.outer(t, w) + phase) @ (0.8 / w)
    v, a = derived(place, dt).T
    force = 20.0 * a / scale + 15.0 * v / scale + 8.0 * np.sign(v) + 100.0
    y = (force + rng.normal(0.0, 0.5, len(t)))[:, None]
    seen = derived(place + rng.normal(0.0, noise * scale, len(t)), dt)
    draws = [derived(rng.normal(0.0, noise * scale, len(t)), dt) for _ in range(3)]
    problem = Problem(
        DriveForce(), (make_block(t=(t * 1e9).astype(np.int64), u=seen, y=y),),
        tuple(TRUTH), filter=lambda c: sosfiltfilt(SOS, c, axis=0),
    )  # fmt: skip
    plain = solve(problem)
    return plain, blurred(problem, plain, Drawn(seen, draws) if noise else None)


def held(fit: Fit, name: str, scale: float = 1.0) -> bool:
    low, high = fit.interval(name)
    size = scale if name in ("mass", "Fv") else 1.0
    return low <= TRUTH[name] / size <= high


@pytest.mark.parametrize("noise", [0.001, 0.002, 0.004])
@pytest.mark.parametrize("scale", [0.1, 1.0])
def test_intervals_hold_though_the_place_is_noisy(noise: float, scale: float) -> None:
    pairs = [fits(seed, noise, scale) for seed in range(5)]
    plain = [held(one, "mass", scale) for one, _ in pairs]
    told = [held(one, name, scale) for _, one in pairs for name in TRUTH]
    assert sum(plain) <= 2
    assert sum(told) >= 0.9 * len(told)


def test_what_is_mostly_noise_cannot_be_told() -> None:
    plain, told = fits(0, 0.03)
    assert plain.verdict[0] == "identifiable"
    assert told.verdict[0] == "weak"
    assert "mostly noise" in told.reasons[0]
    assert held(told, "mass")
    assert told["mass"] == plain["mass"]


def test_without_noise_a_fit_stays() -> None:
    plain, told = fits(0, 0.0)
    assert told is plain


def test_what_is_hardly_noise_is_told_as_before() -> None:
    plain, told = fits(0, 0.00005)
    assert told.verdict == plain.verdict
    width = [np.diff(one.interval95)[0, 0] for one in (plain, told)]
    assert width[1] < 2.0 * width[0]


def test_a_fit_that_did_not_converge_is_left_as_it_is() -> None:
    plain, _ = fits(0, 0.001)
    lost = replace(plain, converged=False)
    problem = Problem(DriveForce(), (make_block(t=[0], u=[[0.0, 0.0]], y=[[0.0]]),), ("mass",))
    assert blurred(problem, lost, Drawn(np.zeros((1, 2)), ())) is lost
