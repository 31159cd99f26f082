"""Sensors of few steps stay where they are while their machine moves by less, rests, or has turned
to them late: sound, until they stay where it goes on."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Mark, fold, make_block
from evertwin.models import FunctionModel
from evertwin.signals import Layout
from evertwin.sync import Arbiter, Rule, Track

ROWS, AT = 2600, 2000
TOLD = ("measurement_error", "at_limit")
"""Of one that froze where all its values end both are right: it may be a stop of the machine."""


def commands(rng: np.random.Generator, hold: int, rest: float) -> np.ndarray:
    """Random levels that last half to twice ``hold`` rows, some of them rests."""
    many = 2 * ROWS // hold
    levels = np.where(rng.random(many) < rest, 0.0, rng.normal(size=many))
    return np.repeat(levels, rng.integers(hold // 2, 2 * hold, many))[:ROWS]


def cart(rng: np.random.Generator) -> tuple[FunctionModel, np.ndarray, np.ndarray]:
    """A way by a speed that is 5 % off and rests."""
    u = commands(rng, 50, 0.3)
    model = FunctionModel(
        lambda x, u, dt, p: ((z := [x[0] + 0.05 * u[0]]), z),
        Layout.of(u="m/s"), Layout.of(y="m"), Layout.of(y="m"),
    )  # fmt: skip
    return model, u, np.cumsum(0.05 * rng.uniform(0.95, 1.05) * u)


def oven(rng: np.random.Generator) -> tuple[FunctionModel, np.ndarray, np.ndarray]:
    """A heated body of 10 to 100 rows, 5 % off."""
    slow = 10.0 ** rng.uniform(1.0, 2.0)
    off, keeps = rng.uniform(0.95, 1.05), np.exp(-1.0 / slow)
    u, y = 20.0 + 10.0 * commands(rng, int(1.5 * slow) + 20, 0.1), np.empty(ROWS)
    x = u[0]
    for k in range(ROWS):
        y[k] = x = off * u[k] + (x - off * u[k]) * keeps ** (1.0 / off)
    model = FunctionModel(
        lambda x, u, dt, p: ((z := [u[0] + (x[0] - u[0]) * keeps]), z),
        Layout.of(u="K"), Layout.of(y="K"), Layout.of(y="K"),
    )  # fmt: skip
    return model, u, y


@pytest.mark.parametrize("machine", [cart, oven])
@pytest.mark.parametrize("late", [False, True])
def test_one_of_few_steps_is_blamed_where_it_froze_and_nowhere_else(
    machine: object, late: bool
) -> None:
    accused, found, could = 0, 0, 0
    for seed in range(25):
        rng = np.random.default_rng([seed, 5])
        model, u, y = machine(rng)  # type: ignore[operator]
        step = np.ptp(y) * 10.0 ** rng.uniform(-3.0, -1.5)
        behind = int(rng.integers(1, 4)) if late else 0
        raw = np.concatenate([np.full(behind, y[0]), y[: ROWS - behind]])
        seen = step * np.round((raw + rng.normal(0.0, 0.3 * step, ROWS)) / step)
        seen[AT:] = seen[AT]
        block = make_block(np.arange(ROWS) * 10**9, u[:, None], seen[:, None])
        stage = Track(model, Arbiter(Rule(use="blend")))
        state = stage.init()
        _, out = fold(stage, [block], state._replace(x=y[:1].copy(), x0=y[:1].copy()))
        told = [r.row for r in out.records if r.kind in TOLD and not r.evidence.get("over")]
        accused += any(row < AT for row in told)
        far = np.flatnonzero(np.abs(y[AT:] - y[AT]) > 10.0 * step)
        could += len(far) > 0
        found += len(far) > 0 and any(AT <= row < AT + far[0] + 60 for row in told)
    assert accused <= 3 and could >= 20 and found >= 0.9 * could, (accused, found, could)


def test_one_that_stood_with_its_machine_is_told_frozen_later() -> None:
    """A cart does not move below a command that is different from cart to cart."""
    accused, found = 0, 0
    for seed in range(25):
        rng = np.random.default_rng([seed, 6])
        model, u, _ = cart(rng)
        y = np.cumsum(np.where(np.abs(u) < rng.uniform(0.2, 0.5), 0.0, 0.05 * u))
        seen = 0.02 * np.round(y / 0.02)
        seen[AT:] = seen[AT]
        block = make_block(np.arange(ROWS) * 10**9, u[:, None], seen[:, None])
        _, out = fold(Track(model, Arbiter(Rule(use="blend"))), [block])
        told = [r.row for r in out.records if r.kind in TOLD and not r.evidence.get("over")]
        accused += sum(row < AT for row in told)
        found += (out.rows.mark[AT:, 0] == Mark.ERROR).mean() > 0.5
    assert accused <= 2 * 25 and found >= 24, (accused, found)


def test_one_that_is_back_at_the_value_before_has_answered() -> None:
    """A force by a command of few levels: so are its values."""
    model = FunctionModel(
        lambda x, u, dt, p: ([], [u[0]]), Layout.of(u="A"), Layout.of(y="N"), Layout()
    )
    for seed in range(25):
        rng = np.random.default_rng([seed, 8])
        u = 5.0 + 3.0 * rng.choice([-1.0, 0.0, 0.5], ROWS // 20).repeat(20)
        seen = np.round(1.02 * u / 0.5) * 0.5
        block = make_block(np.arange(ROWS) * 10**9, u[:, None], seen[:, None])
        _, out = fold(Track(model, Arbiter(Rule(use="blend"))), [block])
        assert not [r for r in out.records if r.kind == "measurement_error"]


def stopped(seed: int, case: str) -> tuple[list[str], np.ndarray]:
    """Kinds of what is told of a store whose level has a brim, or whose sensor ends, or freezes at
    the largest value so far or halfway; and its marks since then."""
    rng = np.random.default_rng([seed, 8])
    u, y = 5.0 + 2.0 * commands(rng, 60, 0.0), np.empty(ROWS)
    u[:60] = 4.0  # it has gone both ways: of one that only rose nobody knows that it may end
    x, keeps = 5.0, np.exp(-1.0 / 30.0)
    for k in range(ROWS):
        x = u[k] + (x - u[k]) * keeps
        x = min(x, 6.5) if case == "brim" else x
        y[k] = min(x, 6.5) if case == "scale" else x
    seen = y + rng.normal(0.0, 0.01, ROWS)
    since = 0
    if case in ("brim", "scale"):
        seen = np.where(y >= 6.5, 6.5, np.minimum(seen, 6.5))
    else:
        off = np.abs(seen - np.median(seen))[500:1500]
        since = 500 + int(np.argmax(seen[500:1500]) if case == "highest" else np.argmin(off))
        seen[:since] = np.minimum(seen[:since], seen[since] + 10.0 * (case == "middle"))
        seen[since:] = seen[since]
    model = FunctionModel(
        lambda x, u, dt, p: ((z := [u[0] + (x[0] - u[0]) * keeps]), z),
        Layout.of(u="V"), Layout.of(y="V"), Layout.of(y="V"),
    )  # fmt: skip
    block = make_block(np.arange(ROWS) * 10**9, u[:, None], seen[:, None])
    stage = Track(model, Arbiter(Rule(use="blend")))
    _, out = fold(stage, [block], stage.init()._replace(x=seen[:1].copy(), x0=seen[:1].copy()))
    return [r.kind for r in out.records], out.rows.mark[since:, 0]


@pytest.mark.parametrize("case", ["brim", "scale"])
def test_a_brim_or_a_full_scale_is_no_frozen_sensor(case: str) -> None:
    told = [stopped(seed, case)[0] for seed in range(12)]
    assert sum("at_limit" in kinds for kinds in told) >= 11
    assert sum("measurement_error" in kinds for kinds in told) <= 1


@pytest.mark.parametrize("case", ["highest", "middle"])
def test_one_that_froze_is_told_at_its_highest_value_too(case: str) -> None:
    found = [stopped(seed, case) for seed in range(12)]
    assert sum("measurement_error" in kinds for kinds, _ in found) >= 11
    assert sum((mark == Mark.ERROR).mean() > 0.9 for _, mark in found) >= 11
