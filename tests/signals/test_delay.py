"""Planted lags and clock offsets are recovered, inside the stated uncertainty."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.signals.delay import clock_offset, lag

Motion = Callable[[np.ndarray], np.ndarray]


def motion(rng: np.random.Generator, highest: float = 2.0) -> Motion:
    frequency, phase = rng.uniform(0.1, highest, 40), rng.uniform(0, 2 * np.pi, 40)
    size = rng.normal(size=40) / np.sqrt(40)
    return lambda t: np.sin(2 * np.pi * np.outer(t, frequency) + phase) @ size


def ns(t: np.ndarray) -> np.ndarray:
    return np.rint(t * 1e9).astype(np.int64)


def test_uncertainty_is_honest() -> None:
    """Jittered 20 Hz command, 50 Hz measurement with noise; 60 planted lags of ±0.2 s."""
    z = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        move, tau = motion(rng), rng.uniform(-0.2, 0.2)
        ta = np.arange(0, 30, 0.05) + rng.uniform(0, 0.04, 600)
        tb = np.arange(0, 30, 0.02)
        b = 0.8 * move(tb - tau) + 0.02 * rng.normal(size=len(tb)) + 3.0
        found = lag(ns(ta), move(ta), ns(tb), b, longest=0.5)
        assert found.verdict == "identified" and abs(found.gain - 0.8) < 0.05
        z.append((found.seconds - tau) / found.sigma)
    inside = np.mean(np.abs(z) < 1.96)
    assert inside >= 0.88 and 0.7 < np.sqrt(np.mean(np.square(z))) < 1.3


def test_an_inverted_signal_has_a_negative_gain() -> None:
    move = motion(np.random.default_rng(1))
    t = np.arange(0, 20, 0.01)
    found = lag(ns(t), move(t), ns(t), -2 * move(t - 0.05), longest=0.3)
    assert abs(found.seconds - 0.05) < 1e-3 and abs(found.gain + 2) < 0.01


def test_absent_samples_do_not_count() -> None:
    rng = np.random.default_rng(2)
    move = motion(rng)
    t = np.arange(0, 30, 0.02)
    b = move(t - 0.1)
    b[rng.integers(0, len(t), 200)] = np.nan
    b[500:600] = np.nan
    found = lag(ns(t), move(t), ns(t), b, longest=0.4)
    assert abs(found.seconds - 0.1) < 2e-3


def test_no_motion_no_lag() -> None:
    t = np.arange(0, 20, 0.02)
    found = lag(ns(t), np.ones(len(t)), ns(t), np.ones(len(t)), longest=0.3)
    assert found.verdict == "not" and np.isnan(found.seconds) and np.isinf(found.sigma)
    assert "does not change" in found.reason


def test_noise_alone_is_not_identified() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(0, 40, 0.02)
    verdicts = [
        lag(ns(t), rng.normal(size=len(t)), ns(t), rng.normal(size=len(t)), 0.3).verdict
        for _ in range(20)
    ]
    assert "identified" not in verdicts


def test_a_repeating_motion_is_ambiguous() -> None:
    t = np.arange(0, 40, 0.02)
    found = lag(ns(t), np.sin(10 * t), ns(t), np.sin(10 * (t - 0.1)), longest=1.5)
    assert found.verdict == "weak" and "repeats" in found.reason


def test_beyond_the_reach() -> None:
    move = motion(np.random.default_rng(4), 0.2)
    t = np.arange(0, 60, 0.02)
    found = lag(ns(t), move(t), ns(t), move(t - 1.0), longest=0.2)
    assert found.verdict == "not" and "look further" in found.reason


def test_too_little_in_common() -> None:
    t = np.arange(0, 10, 0.02)
    x = np.sin(t)
    with pytest.raises(DataError, match="overlap"):
        lag(ns(t), x, ns(t + 9.9), x, longest=0.1)
    with pytest.raises(DataError, match="look at shorter lags"):
        lag(ns(t), x, ns(t), x, longest=5.0)
    with pytest.raises(DataError, match="3 samples"):
        lag(ns(t[:2]), x[:2], ns(t), x, longest=0.1)


@pytest.mark.parametrize("drift", [0.0, 2e-4])
def test_clock_offset_and_drift(drift: float) -> None:
    rng = np.random.default_rng(5)
    move = motion(rng)
    t = np.arange(0, 200, 0.02)
    other = t + 0.25 + drift * t  # the second clock's stamps of the same instants
    noise = 0.01 * rng.normal(size=(2, len(t)))
    found = clock_offset(ns(t), move(t) + noise[0], ns(other), move(t) + noise[1], longest=0.6)
    truth = 0.25 + drift * (found.middle * 1e-9)
    assert abs(found.seconds - truth) < max(4 * found.sigma, 3e-4)
    assert abs(found.drift - drift) < max(4 * found.drift_sigma, 1e-5)
    assert len(found.pieces) == 5


def test_clock_offset_without_motion() -> None:
    t = np.arange(0, 100, 0.02)
    with pytest.raises(DataError, match="no piece"):
        clock_offset(ns(t), np.ones(len(t)), ns(t), np.ones(len(t)), longest=0.3)


def test_two_pieces_give_no_drift() -> None:
    move = motion(np.random.default_rng(6))
    t = np.arange(0, 60, 0.02)
    found = clock_offset(ns(t), move(t), ns(t), move(t - 0.1), longest=0.3, pieces=2)
    assert np.isinf(found.drift_sigma) and abs(found.seconds - 0.1) < 1e-3
