"""Intervals count what the noise of the rows that predictions begin with does, in all outputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.fold import Block, make_block
from evertwin.models import FunctionModel, Model, Parameters
from evertwin.models.functions.translated import translated
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve
from planted.draws import first_of

TRUE, NOISE = np.array([2.4, 1.7, 35.0]), np.array([1e-4, 1e-3])
SEEDS = 60


def step(x: Any, u: Any, dt: float, p: Any) -> Any:
    q, v, h = x[0], x[1], dt / 4
    for _ in range(4):
        a = (u[0] - p[1] * v - p[2] * q) / p[0]
        middle = v + 0.5 * h * a
        a = (u[0] - p[1] * middle - p[2] * (q + 0.5 * h * v)) / p[0]
        q, v = q + h * middle, v + h * a
    return [q, v], [q, v]


@pytest.fixture(scope="module")
def mass() -> Model:
    """A mass on a spring, position and speed measured."""
    both = Layout.of(pos="m", vel="m/s")
    numbers = Parameters.of(m=(2.0, "kg"), c=(1.5, "N*s/m"), k=(30.0, "N/m"))
    return translated(FunctionModel(step, Layout.of(F="N"), both, both, numbers))


def recording(mass: Model, seed: int, n: int) -> Block:
    rng = np.random.default_rng(seed)
    force = np.repeat(rng.uniform(-20, 20, n // 25), 25)[:, None]
    _, y = mass.simulate(np.zeros(2), force[:-1], np.full(n - 1, 0.02), TRUE)
    seen = np.vstack([[0.0, 0.0], y]) + NOISE * rng.normal(size=(n, 2))
    return make_block(t=np.arange(n) * 20_000_000, u=np.vstack([force[:1], force[:-1]]), y=seen)


@first_of(("n", "horizon"), [(500, 0.5), (1000, 0.25), (1000, 0.5), (1000, 2.0)])
def test_intervals_hold_what_was_planted(mass: Model, n: int, horizon: float) -> None:
    """Of 180 nine should not; 22 to 29 did not."""
    off = []
    for seed in range(SEEDS):
        problem = Problem(mass, (recording(mass, seed, n),), ("m", "c", "k"), horizon)
        fit = solve(problem)
        off.append((fit.values - TRUE) / fit.sigma)
    found = np.array(off)
    assert np.count_nonzero(np.abs(found) > 1.96) <= 19, np.count_nonzero(np.abs(found) > 1.96, 0)
    assert (found.std(axis=0) > 0.75).all()  # nor are they wide for nothing
