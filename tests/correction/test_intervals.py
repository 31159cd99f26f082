"""Intervals of thresholds, delays and nodes hold the planted value as often as they say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from evertwin.correction.evidence import gather
from evertwin.correction.numbers.intervals import Known, profiled, scattered
from evertwin.fold import Block, make_block
from evertwin.machines.mobile import Robot1D
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.form import Term

NOISE = 2e-3


def rows(seed: int, truth: Corrected, p: np.ndarray, n: int = 300, hold: int = 3) -> Block:
    """A robot on a line at 1 Hz with held random commands, position noise 2 mm."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.0, 0.2, n // hold), hold)[:, None]
    dt = np.ones(len(u))
    _, y = truth.simulate(truth.initial(p), u, dt, p)
    y = y + rng.normal(0.0, NOISE, y.shape)
    return make_block(t=np.arange(len(u)) * 10**9, u=u, y=y)


def model_of(*terms: Term, **values: float) -> tuple[Corrected, np.ndarray]:
    model = Corrected(Robot1D(), terms)
    named = {name.replace("__", "."): value for name, value in values.items()}
    return model, model.parameters.with_values(named).values


def best(model: Corrected, p: np.ndarray, name: str, grid: np.ndarray, block: Block) -> np.ndarray:
    """The parameters with one number at the least cost on a grid."""
    seen = gather(Robot1D(), (block,), 3.0)
    place = model.parameters.index(name)
    costs = []
    for value in grid:
        q = p.copy()
        q[place] = value
        costs.append(float((seen.residual(model, q) ** 2).sum()))
    q = p.copy()
    q[place] = grid[int(np.argmin(costs))]
    return q


def holds(known: Known, value: float) -> bool:
    return known.interval95[0] <= value <= known.interval95[1]


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["dead zone", "clamp"])
def test_the_interval_of_a_threshold_holds_the_planted_one(variant: str) -> None:
    model, p = model_of(Term("law", "v", variant=variant), law__v__threshold=0.06)
    name, held, widths = "law.v.threshold", 0, []
    for seed in range(30):
        block = rows(seed, model, p)
        q = best(model, p, name, np.linspace(0.03, 0.09, 121), block)
        found = profiled(model, q, (name,), (), gather(Robot1D(), (block,), 3.0))[name]
        held += holds(found, 0.06)
        widths.append(found.interval95[1] - found.interval95[0])
    assert held >= 26
    assert np.median(widths) < 0.012


@pytest.mark.slow
def test_the_interval_of_a_delay_holds_the_planted_one() -> None:
    model, p = model_of(Term("lag", "v", variant="delay"), lag__v__delay=0.3)
    held, widths = 0, []
    for seed in range(30):
        block = rows(seed, model, p)
        q = best(model, p, "lag.v.delay", np.linspace(0.2, 0.4, 81), block)
        found = profiled(model, q, ("lag.v.delay",), (), gather(Robot1D(), (block,), 3.0))
        held += holds(found["lag.v.delay"], 0.3)
        widths.append(np.diff(found["lag.v.delay"].interval95)[0])
    assert held >= 26
    assert 0.002 < np.median(widths) < 0.05


def test_a_delay_beside_a_time_constant_shares_what_is_known() -> None:
    """A pose once a second tells their sum; each ends at the other's zero."""
    model, p = model_of(Term("lag", "v"), lag__v__delay=0.05, lag__v__tau=0.1)
    names = ("lag.v.delay", "lag.v.tau")
    found = profiled(model, p, names, names, gather(Robot1D(), (rows(1, model, p),), 3.0))
    assert found["lag.v.delay"].interval95[0] == 0.0
    assert 0.1 < found["lag.v.delay"].interval95[1] < 0.25
    assert 0.1 < found["lag.v.tau"].interval95[1] < 0.25


def test_a_cap_that_nothing_reaches_is_open_to_one_side() -> None:
    model, p = model_of(Term("law", "v"), law__v__cap=0.5)
    found = profiled(model, p, ("law.v.cap",), (), gather(Robot1D(), (rows(2, model, p),), 3.0))
    low, high = found["law.v.cap"].interval95
    assert low == pytest.approx(0.2, abs=0.02) and math.isinf(high)
    assert found["law.v.cap"].verdict == "not"


def test_nodes_are_known_by_their_rows() -> None:
    """Coverage over nodes and seeds; a node that no command comes near is not known."""
    levels = (0.0, 0.05, 0.1, 0.15, 0.2, 0.4, 0.6)
    term = Term("table", "v", variant="linear", levels=levels)
    model, p = model_of(term)
    names = tuple(f"table.v.{k}" for k in range(len(levels)))
    held = count = 0
    for seed in range(12):
        block = rows(seed, model, p)
        seen = gather(Robot1D(), (block,), 3.0)
        place = model.parameters.index("table.v.2")
        effect = []
        for at in (p[place], p[place] + 1e-4):
            q = p.copy()
            q[place] = at
            effect.append(seen.residual(model, q).ravel())
        slope = (effect[1] - effect[0]) / 1e-4
        q = p.copy()
        q[place] -= float(slope @ effect[0] / (slope @ slope))
        known = scattered(model, q, names, seen)
        held += holds(known["table.v.2"], 0.1)
        count += 1
        assert known["table.v.6"].verdict == "not"
        assert known["table.v.2"].verdict == "identifiable"
    assert held >= count - 2
