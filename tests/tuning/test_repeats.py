"""Recordings that contradict each other about a number are told, and widen its interval."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from evertwin.fold import Block, make_block
from evertwin.machines.drive import DriveForce
from evertwin.machines.mobile import Robot1D
from evertwin.tuning import Problem, repeated, solve

NAMES = ("mass", "Fv", "Fc")


def day(rng: np.random.Generator, fc: float, memory: float = 0.0) -> Block:
    t = np.arange(300) * 0.02
    w, phase = rng.uniform(1.0, 6.0, 3), rng.uniform(0.0, 6.0, 3)
    v = np.sin(np.outer(t, w) + phase).sum(axis=1)
    a = (w * np.cos(np.outer(t, w) + phase)).sum(axis=1)
    white = 0.3 * rng.normal(size=300)
    noise = scipy.signal.lfilter([1.0], [1.0, -memory], white)
    y = 2.0 * a + 3.0 * v + fc * np.sign(v) + noise
    u = np.stack([v, a], axis=1)
    return make_block(t=np.arange(300) * 20_000_000, u=u, y=y[:, None])


def problem(days: list[Block]) -> Problem:
    return Problem(DriveForce(), tuple(days), NAMES)


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_recordings_that_agree_are_seldom_called_different(memory: float) -> None:
    wider = 0
    for seed in range(100):
        rng = np.random.default_rng([1, seed])
        posed = problem([day(rng, 5.0, memory) for _ in range(6)])
        wider += any("differs" in why for why in repeated(posed, solve(posed)).reasons)
    assert wider <= 4


def test_an_interval_holds_for_the_next_recording_too() -> None:
    held = {"plain": 0, "told": 0}
    for seed in range(100):
        rng = np.random.default_rng([2, seed])
        posed = problem([day(rng, rng.normal(5.0, 0.5)) for _ in range(6)])
        plain, following = solve(posed), rng.normal(5.0, 0.5)
        told = repeated(posed, plain)
        np.testing.assert_array_equal(told.values, plain.values)
        for name, fit in (("plain", plain), ("told", told)):
            low, high = fit.interval("Fc")
            held[name] += low <= following <= high
        assert "among 6 recordings" in told.reasons[NAMES.index("Fc")]
    assert held["plain"] < 60 and held["told"] >= 90


def test_many_short_recordings_are_grouped_and_two_are_not_compared() -> None:
    rng = np.random.default_rng(3)
    posed = problem([day(rng, 4.0 + 0.1 * k) for k in range(20)])
    (said,) = [why for why in repeated(posed, solve(posed)).reasons if "differs" in why]
    assert "among 8 groups of recordings" in said
    posed = problem([day(rng, 4.0), day(rng, 6.0)])
    fit = solve(posed)
    assert repeated(posed, fit) is fit


def test_parts_of_one_recording_are_compared_of_a_model_with_a_state() -> None:
    rng = np.random.default_rng(4)
    u = np.repeat(rng.uniform(0.05, 0.2, 80), 5)
    gain = np.linspace(0.8, 1.2, 400)  # it drives ever faster
    y = np.cumsum(gain * u) + 1e-3 * rng.normal(size=400)
    rows = make_block(t=np.arange(400) * 10**9, u=u[:, None], y=y[:, None])
    posed = Problem(Robot1D(), (rows,), ("gain",), horizon=5.0)
    plain = solve(posed)
    told = repeated(posed, plain)
    low, high = told.interval("gain")
    assert "among 8 parts" in told.reasons[0]
    assert low < 0.85 and high > 1.15 and high - low > 2 * np.diff(plain.interval("gain"))[0]
