"""A number whose interval is a multiple of its size keeps its value, however well it fits."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.machines.mobile import Omni
from evertwin.refit.numbers.undetermined import known, weakened
from evertwin.tuning import Fit, Problem, solve


def sideways(seed: int, speed: float) -> Fit:
    """Of a base that goes forwards, and sideways at a speed that its noise of 3 mm may hide."""
    rng, u = np.random.default_rng(seed), np.zeros((50, 3))
    u[:, :2] = 0.1, speed
    y = np.stack([0.008 * np.arange(1, 51), 0.08 * speed * np.arange(1, 51), np.zeros(50)], axis=1)
    rows = make_block(t=np.arange(50) * 10**8, u=u, y=y + rng.normal(0.0, 3e-3, (50, 3)))
    return solve(Problem(Omni(), (rows,), ("gain", "side_gain")))


@pytest.mark.parametrize("seed", range(20))
def test_what_is_hidden_in_noise_is_not_told(seed: int) -> None:
    fit = sideways(seed, 1e-4)
    moved = fit["side_gain"] != 1.0
    rest = known(fit, ("gain", "side_gain"))
    assert (rest is not None) == moved
    if rest is not None:
        assert rest.names == ("gain",)
        assert rest.why.startswith("what the rows do not tell stays as it was (side_gain: its 95 %")


@pytest.mark.parametrize("seed", range(20))
def test_what_shows_is_told(seed: int) -> None:
    assert known(sideways(seed, 0.1), ("gain", "side_gain")) is None


def test_a_recordings_start_is_no_number_that_goes_live() -> None:
    fit = next(one for one in (sideways(seed, 1e-4) for seed in range(20)) if one["side_gain"] != 1)
    rest = known(fit, ("side_gain",))
    assert rest is not None and not rest.names


def test_what_is_refuted_where_it_was_is_weak_and_the_rest_as_told() -> None:
    fit = next(one for one in (sideways(seed, 1e-4) for seed in range(20)) if one["side_gain"] != 1)
    rest = known(fit, ("gain", "side_gain"))
    assert rest is not None
    found = weakened(fit, rest)
    assert known(found, ("gain", "side_gain")) is None
    assert found.verdict == (fit.verdict[0], "weak")
    assert found.reasons[1].endswith("no more is told of it than that it is not as before")
