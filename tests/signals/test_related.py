"""Whether a motion follows a command: of its own machine or another, drawn."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from evertwin.signals.related import Follows, follows

STEP = 0.02


def drawn(rng: np.random.Generator, seconds: float) -> tuple[np.ndarray, ...]:
    """Stamps and turn rate of a command, stamps and heading of the base that it drives."""
    n = int(seconds / STEP)
    t = STEP * np.arange(n)
    hold = int(rng.integers(5, 20))
    if rng.random() < 0.5:
        w = rng.uniform(-0.9, 0.9, 999)[np.searchsorted(np.cumsum(rng.uniform(2, 5, 999)), t)]
    else:
        w = np.clip(scipy.signal.lfilter([0.01], [1, -0.99], rng.normal(0, 5, n)), -0.8, 0.8)
    w = np.repeat(w[::hold], hold)[:n]
    late, zone = int(rng.uniform(0, 0.8) / STEP), rng.uniform(0, 0.15)
    moved = np.append(np.zeros(late), w[: n - late])
    moved = rng.uniform(0.6, 1.1) * np.sign(moved) * np.maximum(np.abs(moved) - zone, 0)
    pole = np.exp(-STEP / rng.uniform(0.05, 0.8))
    heading = STEP * np.cumsum(scipy.signal.lfilter([1 - pole], [1, -pole], moved))
    every = int(rng.integers(2, 10))
    noise = rng.normal(0, 0.004, len(t[::every]))
    return t[::hold], w[::hold], t[::every], heading[::every] + noise


@pytest.mark.parametrize("seconds", [60.0, 240.0])
def test_a_base_follows_its_own_command_and_no_other(seconds: float) -> None:
    own, other = list[Follows](), list[Follows]()
    for seed in range(100):
        rng = np.random.default_rng(seed)
        (ta, w, tb, heading), (tc, foreign, *_) = drawn(rng, seconds), drawn(rng, seconds)
        own.append(follows(ta, w, tb, heading))
        other.append(follows(tc, foreign, tb, heading))
    assert not any(one.clear for one in other)
    assert not any(one.unrelated for one in own)
    assert sum(one.clear for one in own) >= (95 if seconds > 100 else 80)
    if seconds > 100:
        assert sum(one.unrelated for one in other) >= 80


@pytest.mark.parametrize("count", [0, 1, 39])
def test_too_little_tells_nothing(count: int) -> None:
    t = np.arange(float(count))
    found = follows(t, t, t, t)
    assert found == (0.0, np.inf)
    assert not found.clear and not found.unrelated
