"""Rows that are folded over many beats at once come out as beat by beat, bit for bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.config.spec import (
    AnomalySpec,
    ClockSpec,
    CorrectionSpec,
    FilterSpec,
    ModelSpec,
    PredictionSpec,
    Span,
    TuningSpec,
    TwinSpec,
)
from evertwin.fold import Block, canonical, make_block, take
from evertwin.fold.state import equal
from evertwin.ledger.versions import Versions
from evertwin.loop.driver import Driver
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TwinState
from planted.draws import first_of

from .machines import robot

CART = TwinSpec(
    "cart", ModelSpec("robot1d"), beat=Span(10), clock=ClockSpec(rate=1.0),
    prediction=PredictionSpec(horizon=5.0), tuning=TuningSpec(window=Span(300)),
    correction=CorrectionSpec(terms=()),
    anomaly=AnomalySpec(requirement=0.02, relative=False, window=Span(100)),
)  # fmt: skip


def rows(seed: int, n: int = 6_000) -> Block:
    """A cart that drives 10 % too fast, later 20 %, and is pushed once."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(0.0, 0.2, n // 10), 10)
    gain = np.where(np.arange(n) < n // 2, 1.1, 1.2)
    x = np.cumsum(np.r_[0.0, (gain * v)[1:]]) + rng.normal(0.0, 0.002, n)
    x[n // 3 :] += 0.7
    task = (np.arange(n) >= n // 5).astype(np.int64)
    return make_block(np.arange(n) * 10**9, v[:, None], x[:, None], task=task)


def folded(spec: TwinSpec, block: Block, size: int) -> tuple[TwinState, list[str]]:
    setup = Setup(spec, model_of(spec, None))
    log: list[str] = []
    driver = Driver(
        setup, Versions(setup.model), lambda row, said: log.extend(map(canonical, said))
    )
    state = driver.init()
    for start in range(0, len(block.t), size):
        state = driver.step(state, take(block, start, min(start + size, len(block.t))))
    return driver.finish(state), log


@pytest.mark.parametrize("filtered", [False, True], ids=["plain", "filtered"])
@first_of("seed", [0, 1, 2])
def test_many_beats_at_once_are_beat_by_beat(seed: int, filtered: bool) -> None:
    spec = replace(CART, filter=FilterSpec(cutoff=0.2)) if filtered else CART
    whole, one_beat = folded(spec, rows(seed), 10**6), folded(spec, rows(seed), 9)
    assert whole[1] == one_beat[1] and equal(whole[0], one_beat[0])
    assert whole[0].live.version > 0
    assert any("overruled" in said for said in whole[1])
    assert any("suspected" in said for said in whole[1])


def test_leaving_what_a_correction_was_learned_for_is_seen_at_its_beat() -> None:
    found, rng, n = robot(), np.random.default_rng(2), 1500
    rule = replace(found.spec.correction, watch=("v",))
    v = 0.01 * np.repeat(rng.integers(0, 13, n // 5), 5)
    v[1000:] += 0.08
    driven = np.where(v < 0.06, 0.0, v)
    x = np.cumsum(np.r_[0.0, driven[1:]]) + rng.normal(0.0, 0.002, n)
    block = make_block(np.arange(n) * 10**9, v[:, None], x[:, None])
    spec = replace(found.spec, correction=rule)
    whole, one_beat = folded(spec, block, 10**6), folded(spec, block, 4)
    assert whole[1] == one_beat[1] and equal(whole[0], one_beat[0])
    (restarted,) = (said for said in whole[1] if "training_restarted" in said)
    assert '"row":1005' in restarted
