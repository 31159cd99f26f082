"""A load on some of the rows: told by these, whatever the others say."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.refit.rows.state_rows import Part, while_there
from evertwin.signals import Layout
from evertwin.tuning import Problem
from evertwin.types import Float64, Vector
from planted.draws import first_of

EMPTY = {"m": 0.0}
TABLE = FunctionModel(
    lambda x, u, dt, p: ([], [(20.0 + p[0]) * u[0] + 30.0 * u[1]]),
    Layout.of(a="m/s**2", v="m/s"), Layout.of(F="N"), parameters=Parameters.of(m=(0.0, "kg")),
)  # fmt: skip


def off(problem: Problem, values: Vector) -> Float64[np.ndarray, " n"]:
    squares = np.where(problem.rows.used, np.square(problem.residuals(values)), 0.0)
    return np.asarray(squares.sum(axis=1))


def part(seed: int, *, goes: bool) -> tuple[Part, float]:
    """A table of 20 kg at some rate, with a load of 3 to 15 kg: all the time, or for half of each
    cycle of 3 to 15 s; friction that is off by up to 10 %. With the load."""
    rng = np.random.default_rng(seed)
    rate, load, cycle = rng.choice([10.0, 20.0, 40.0]), rng.uniform(3.0, 15.0), rng.uniform(3, 15)
    t = np.arange(round(40.0 * rate)) / rate
    rates = rng.uniform(1.0, 6.0, 3)
    a, v = (wave(np.outer(t, rates)).sum(axis=1) / 3.0 for wave in (np.cos, np.sin))
    on = (t + rng.uniform(0.0, cycle)) % cycle < cycle / 2 if goes else np.ones(len(t))
    y = (20.0 + load * on) * a + 30.0 * rng.uniform(0.9, 1.1) * v + rng.normal(0.0, 0.5, len(t))
    stamps = np.round(t * 1e9).astype(np.int64)
    rows = (make_block(t=stamps, u=np.stack([a, v], axis=1), y=y[:, None]),)
    return while_there(lambda w: Problem(TABLE, w, ("m",)), rows, EMPTY, off), load


@first_of("seed", range(6))
def test_a_load_that_comes_and_goes_is_no_mean_of_both(seed: int) -> None:
    found, load = part(seed, goes=True)
    assert 0.35 < found.share < 0.65
    assert abs(found.fit["m"] - load) < 0.1 * load


@pytest.mark.parametrize("seed", range(6))
def test_a_load_that_stays_is_told_by_all_rows(seed: int) -> None:
    found, load = part(seed, goes=False)
    assert found.share == 1.0 and abs(found.fit["m"] - load) < 0.1 * load
