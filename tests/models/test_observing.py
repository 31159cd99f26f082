"""States that nothing measures are estimated from what predictions were off by."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Block, make_block, take
from evertwin.machines.mobile import Robot1D
from evertwin.machines.thermal import ThermalBox
from evertwin.models import (
    FunctionModel,
    Model,
    Parameters,
    hidden_of,
    kernel_of,
    observed,
    remembers,
    roll,
)
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.form import Term
from evertwin.signals import Layout
from evertwin.sync import Horizon, restarts

SEEDS = range(20)
DT, HORIZON, SIGMA = 0.5, 5.0, 0.05


def chamber(start: float = 0.0) -> FunctionModel:
    """Air that is measured beside a wall that is not, which begins at ``start``."""

    def step(x, u, dt, p):  # type: ignore[no-untyped-def]
        air, wall = x
        ahead = air + dt * (p[0] * (wall - air) + u[0] - 0.1 * air)
        return [ahead, wall + 0.02 * (air - wall) * dt], [ahead]

    return FunctionModel(
        step, Layout.of(heat="W"), Layout.of(air="K"), Layout.of(air="K", wall="K"),
        Parameters.of(exchange=(0.2, "1/s")), (0.0, start),
    )  # fmt: skip


def recorded(seed: int, n: int = 400, wall: float = 6.0) -> Block:
    """A recording of it from a warm wall."""
    rng = np.random.default_rng(seed)
    model, u = chamber(wall), rng.choice([0.0, 2.0], n // 20).repeat(20)[:, None]
    p = model.parameters.values
    y = model.simulate(model.initial(p), u, np.full(n, DT), p)[1]
    y += SIGMA * rng.standard_normal(y.shape)
    return make_block(t=(np.arange(n) * DT * 1e9).astype(np.int64), u=u, y=y)


def left(model: Model, rows: Block) -> np.ndarray:
    """Measured − predicted over a horizon, (n,)."""
    p = model.parameters.values
    x0 = model.initial(p)
    plan = restarts(rows, HORIZON, x0, remembers(model))
    return (rows.y - roll(kernel_of(model), x0, rows.u, rows.dt, p, plan)[1])[:, 0]


def rms(off: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(off**2)))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_start_that_is_not_known_is_found_within_some_horizons(seed: int) -> None:
    rows = recorded(seed)
    plain, seen = left(chamber(), rows)[30:], left(observed(chamber()), rows)[30:]
    assert rms(plain) > 8 * SIGMA
    assert rms(seen) < 2 * SIGMA


def test_a_start_that_is_known_costs_next_to_nothing() -> None:
    cost = [
        rms(left(observed(chamber(6.0)), rows)[10:]) / rms(left(chamber(6.0), rows)[10:])
        for rows in map(recorded, SEEDS)
    ]
    assert np.median(cost) < 1.03
    assert max(cost) < 1.15


def test_only_what_nothing_measures_is_estimated() -> None:
    assert observed(Robot1D()) == Robot1D()
    assert hidden_of(observed(ThermalBox())) == (0,)
    walled = Corrected(chamber(), (Term("state", "air"), Term("lag", "heat")))
    names = walled.states.names
    found = [names[k] for k in hidden_of(observed(walled))]
    assert found[0] == "wall"
    assert found[1:] == [name for name in names if name.endswith(".difference")]
    shown = chamber()
    told = FunctionModel(
        lambda x, u, dt, p: (shown.row(x, u, dt, p)[0], shown.row(x, u, dt, p)[0]),  # type: ignore[arg-type,return-value]
        shown.inputs, shown.states, shown.states, shown.parameters,
    )  # fmt: skip
    assert hidden_of(observed(told)) == ()
    assert hidden_of(observed(told, np.array([True, False]))) == (1,)


@pytest.mark.parametrize("cuts", [(137,), (11, 12, 250), (30, 300)])
def test_cutting_the_stream_changes_no_bit(cuts: tuple[int, ...]) -> None:
    rows = recorded(3)
    rows = rows._replace(gap=np.arange(len(rows.t)) % 170 == 165)
    stage = Horizon(observed(chamber()), HORIZON)
    whole_state, whole = stage.step(stage.init(), rows)
    state, parts = stage.init(), []
    for a, b in zip((0, *cuts), (*cuts, len(rows.t)), strict=True):
        state, out = stage.step(state, take(rows, a, b))
        parts.append(out.rows.y)
    np.testing.assert_array_equal(np.concatenate(parts), whole.rows.y)
    np.testing.assert_array_equal(state.x, whole_state.x)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_first_horizon_is_no_measure_of_a_model_with_a_hidden_state(seed: int) -> None:
    rows, stage = recorded(seed), Horizon(observed(chamber()), HORIZON)
    off = stage.step(stage.init(), rows)[1].rows.residual[:, 0]
    horizon = round(HORIZON / DT)
    assert np.isnan(off[: horizon + 1]).all()
    assert np.isfinite(off[horizon + 2 :]).all()
    assert rms(off) < 2.5 * SIGMA


def test_pieces_shorter_than_a_horizon_are_judged_after_some() -> None:
    rows = recorded(1)
    rows = rows._replace(task=np.arange(len(rows.t)) // 8)
    off = Horizon(observed(chamber()), HORIZON)
    found = off.step(off.init(), rows)[1].rows.residual[:, 0]
    assert np.isnan(found[:160]).all()
    assert np.isfinite(found[240:]).mean() > 0.8


@pytest.mark.parametrize("seed", SEEDS)
def test_a_hidden_state_lasts_through_a_gap_and_is_put_right_behind_it(seed: int) -> None:
    whole = recorded(seed, 800)
    late = take(whole, 500, 800)
    rows = Block(
        0, *(np.concatenate([a[:400], b]) for a, b in zip(whole[1:], late[1:], strict=True))
    )
    rows.dt[400] = (rows.t[400] - rows.t[399]) * 1e-9
    rows.gap[400] = True
    stage = Horizon(observed(chamber()), HORIZON)
    off = stage.step(stage.init(), rows)[1].rows.residual[:, 0]
    assert np.isnan(off[400 : 400 + round(HORIZON / DT)]).all()
    assert rms(off[402 + round(HORIZON / DT) :]) < 2.5 * SIGMA
