from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Block, make_block
from evertwin.signals import Layout
from evertwin.sync.horizon.lag import shared_lag

from .machines import unicycle

TIMES = np.arange(0, 60, 0.05)


def path(t: np.ndarray) -> np.ndarray:
    """A robot's pose, heading through several turns."""
    heading = 0.4 * t + 0.8 * np.sin(0.9 * t)
    return np.stack([np.sin(t) + np.sin(2.7 * t), np.cos(1.3 * t) + 0.2 * t, heading], axis=1)


def measured(lags: tuple[float, float, float], seed: int = 0) -> Block:
    y = np.stack([path(TIMES - lag)[:, j] for j, lag in enumerate(lags)], axis=1)
    y += np.random.default_rng(seed).normal(0, 0.003, y.shape)
    y[:, 2] = np.arctan2(np.sin(y[:, 2]), np.cos(y[:, 2]))
    return make_block(np.rint(TIMES * 1e9), np.zeros((len(TIMES), 1)), y)


@pytest.mark.parametrize("planted", [-0.2, 0.0, 0.11, 0.35])
def test_a_planted_lag_is_found(planted: float) -> None:
    predicted = path(TIMES)
    predicted[:, 2] = np.arctan2(np.sin(predicted[:, 2]), np.cos(predicted[:, 2]))
    found = shared_lag(measured((planted,) * 3), predicted, unicycle().outputs)
    assert found.agree, found.reason
    assert found.seconds == pytest.approx(planted, abs=0.01)
    assert all(lag.gain == pytest.approx(1.0, abs=0.05) for lag in found.lags.values())


def test_axes_with_lags_of_their_own_share_none() -> None:
    found = shared_lag(measured((0.05, 0.05, 0.3)), path(TIMES), unicycle().outputs)
    assert not found.agree and np.isnan(found.seconds)
    assert "differ: x 0.05 s" in found.reason and "heading 0.299 s" in found.reason


def test_a_flipped_sign_shows_in_the_gain() -> None:
    block = measured((0.1, 0.1, 0.1))
    block.y[:, 0] *= -1
    assert shared_lag(block, path(TIMES), unicycle().outputs).lags["x"].gain < -0.9


def test_without_motion_there_is_no_lag() -> None:
    y = np.random.default_rng(0).normal(0, 0.01, (400, 1))
    block = make_block(np.arange(400) * 10**8, np.zeros((400, 1)), y)
    found = shared_lag(block, np.zeros((400, 1)), Layout.of(x="m"))
    assert not found.agree and np.isnan(found.seconds)
    short = make_block(np.arange(5) * 10**8, np.zeros((5, 1)), y[:5])
    assert not shared_lag(short, np.zeros((5, 1)), Layout.of(x="m")).agree
