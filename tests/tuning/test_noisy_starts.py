"""Predictions that start from noisy measurements."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Block, make_block
from evertwin.models import Parameters
from evertwin.models.functions.translated import Translated
from evertwin.signals import Layout
from evertwin.tuning import solve
from evertwin.tuning.intervals.noisy_starts import noisy, white
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Bools

GAIN, TIME = 1.0, 600.0


def level(
    x: np.ndarray, u: np.ndarray, dt: float, p: np.ndarray
) -> tuple[list[float], list[float]]:
    new = [x[0] + dt * (p[0] * u[0] - x[0]) / p[1]]
    return new, new


TANK = Translated(
    level, Layout.of(q="V"), Layout.of(h="m"), Layout.of(h="m"),
    Parameters.of(gain=(1.2, "m"), time=(800.0, "s")),
)  # fmt: skip


def drawn(seed: int, noise: float, rows: int = 3000) -> Block:
    """A slow level, once a second, beside a pump that is set anew each minute or so."""
    rng, pump = np.random.default_rng(seed), []
    while len(pump) < rows:
        pump += [rng.uniform(1, 7)] * int(rng.uniform(30, 150))
    h, u = np.full(rows, 4.0), np.array(pump[:rows])
    for k in range(rows - 1):
        h[k + 1] = h[k] + (GAIN * u[k] - h[k]) / TIME
    seen = (h + noise * rng.standard_normal(rows))[:, None]
    return make_block(t=np.arange(rows) * 10**9, u=np.r_[u[:1], u[:-1]][:, None], y=seen)


def test_a_slow_time_constant_is_not_too_short() -> None:
    """Least squares alone finds 0.75 times the true one in the median, and outside in 3 of 8."""
    found, inside = [], []
    for seed in range(8):
        fit = solve(Problem(TANK, (drawn(seed, 0.15),), horizon=20.0))
        low, high = fit.interval95[1]
        found.append(fit.values[1] / TIME)
        inside.append(bool(low < TIME < high) or fit.verdict[1] == "not")
    assert 0.9 < np.median(found) < 1.25
    assert sum(inside) >= 7


def test_without_noise_nothing_is_added() -> None:
    problem = Problem(TANK, (drawn(1, 0.0),), horizon=20.0)
    assert solve(problem).values == pytest.approx([GAIN, TIME], rel=1e-6)
    free_run = Problem(TANK, (drawn(1, 0.15),))  # one start among 3,000 rows
    adds = noisy(free_run, free_run.start, np.array([0.15]))
    told = free_run.sensitivity(free_run.start).information(np.array([0.15]))
    assert adds is not None and adds.information[1, 1] < 0.03 * told[1, 1]


def following(rows: int) -> Bools:
    return np.ones(rows, dtype=np.bool_)


def test_what_the_machine_does_at_random_is_no_noise_of_its_sensor() -> None:
    rng = np.random.default_rng(2)
    walk = np.cumsum(rng.standard_normal((20_000, 1)), axis=0)
    assert white(walk, following(20_000))[0] < 0.15
    assert white(walk[:50], following(50))[0] == 0.0  # too few rows to tell
    assert white(rng.standard_normal((20_000, 1)), following(20_000))[0] == pytest.approx(
        1, rel=0.05
    )
