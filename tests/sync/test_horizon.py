from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import UsageError
from evertwin.fold import Block, Mark, check_online, concatenate, equal, fold, make_block, take
from evertwin.models import FunctionModel, roll
from evertwin.signals import Layout
from evertwin.sync import Horizon, residuals, restarts
from evertwin.sync.horizon import horizon_loop

from .machines import drive, drive_rows, unicycle, unicycle_rows


def spoiled(seed: int) -> Block:
    """Rows with every kind of mark and an unknown input."""
    block = unicycle_rows(seed)
    rng = np.random.default_rng(seed)
    block.mark[:, 2:][rng.random((len(block.t), 3)) < 0.1] = Mark.ERROR
    block.mark[:, 2:][rng.random((len(block.t), 3)) < 0.05] = Mark.OVERRULED
    block.u[150] = np.nan
    return block


@given(st.integers(0, 20), st.lists(st.integers(1, 399), max_size=6, unique=True))
@settings(max_examples=15, deadline=None)
def test_partition(seed: int, cuts: list[int]) -> None:
    check_online(Horizon(unicycle(), 0.7), spoiled(seed), [sorted(cuts)])


@pytest.mark.parametrize("horizon", [0.3, 1.0, np.inf])
def test_the_stream_agrees_with_the_roll_out(horizon: float) -> None:
    model, block = unicycle(), spoiled(3)
    p = model.parameters.values
    plan = restarts(block, horizon, model.initial(p))
    _, y = roll(model.kernel(), model.initial(p), block.u, block.dt, p, plan)
    _, out = fold(Horizon(model, horizon), [block])
    np.testing.assert_array_equal(y, out.rows.y)
    np.testing.assert_array_equal(residuals(model, block, y), out.rows.residual)


def test_compiled_and_plain_loop_agree_bit_for_bit(run_as: Callable[[str], None]) -> None:
    stage, block = Horizon(unicycle(), 0.5), spoiled(1)
    run_as("machine code")
    compiled = fold(stage, [block])
    run_as("plain")
    assert equal(fold(stage, [block]), compiled)
    y, anew = np.where(block.mark[:, 2:] == 0, block.y, np.nan), block.gap
    for function in (horizon_loop.plan.compiled, horizon_loop.plan.plain):
        code, adopts = np.zeros(len(y), dtype=np.uint8), np.full_like(y, np.nan)
        function(block.t, anew, y, block.mark[:, 2:] == 5, 10**9, code, adopts)
        last = locals().get("last", (code, adopts))
        assert equal((code, adopts), last)
    known = ~np.isnan(y)
    np.testing.assert_array_equal(
        horizon_loop.began.compiled(anew, known), horizon_loop.began.plain(anew, known)
    )
    rows = block.u, block.y, block.mark
    counts = horizon_loop.counted.compiled(*rows)
    np.testing.assert_array_equal(counts, horizon_loop.counted.plain(*rows))
    fed = np.isfinite(block.u) & ((block.mark[:, :2] <= 2) | (block.mark[:, :2] == 5))
    expected = fed.all(axis=1)[:, None] & ~np.isnan(block.y) & (block.mark[:, 2:] <= 2)
    np.testing.assert_array_equal(counts, expected)


def test_a_wrong_gain_shows_over_one_horizon() -> None:
    """8 % too fast at 0.3 m/s: the spread at the end of 1 s is the model's, not the noise's."""
    loss = {}
    for gain in (1.0, 1.08):
        _, out = fold(Horizon(drive(gain), 1.0), [drive_rows(5, n=3000)])
        assert len(out.rows.losses) == 299
        loss[gain] = out.rows.losses.mean()
    assert np.sqrt(loss[1.0]) == pytest.approx(np.sqrt(2) * 0.01, rel=0.05)
    assert loss[1.08] > 1.5 * loss[1.0]


def test_angles_wrap() -> None:
    _, out = fold(Horizon(unicycle(1.05), 1.0), [unicycle_rows(2)])
    assert np.nanmax(np.abs(out.rows.residual)) < 0.05


def test_a_late_sensor_is_adopted_first_and_compared_then() -> None:
    model = FunctionModel(
        lambda x, u, dt, p: ([x[0] + u[0] * dt, x[1] + u[0] * dt],) * 2,
        Layout.of(v="m/s"), Layout.of(a="m", b="m"), Layout.of(a="m", b="m"),
    )  # fmt: skip
    y = np.stack([np.arange(6.0), 50 + np.arange(6.0)], axis=1)
    y[:3, 1] = np.nan
    block = make_block(t=np.arange(6) * 10**9, u=np.ones((6, 1)), y=y)
    _, out = fold(Horizon(model, 10.0), [block])
    np.testing.assert_array_equal(out.rows.residual[:, 1], [np.nan] * 4 + [0.0, 0.0])
    plan = restarts(block, 10.0, np.zeros(2))
    assert plan.code.tolist() == [2, 0, 0, 0, 1, 0]
    _, predicted = roll(model.kernel(), np.zeros(2), block.u, block.dt, np.zeros(0), plan)
    np.testing.assert_array_equal(residuals(model, block, predicted), out.rows.residual)


def test_a_static_map_never_restarts() -> None:
    model = FunctionModel(
        lambda x, u, dt, p: ([], [2 * u[0]]), Layout.of(v="m/s"), Layout.of(f="N")
    )
    block = drive_rows(1, n=50)
    block.gap[20] = True
    assert not restarts(block, 1.0, np.zeros(0)).code.any()
    _, out = fold(Horizon(model, 1.0), [block])
    assert np.isfinite(out.rows.residual).all()
    assert out.rows.end.sum() == len(out.rows.losses) == 4
    stage = Horizon(model, 1.0)
    state, given = stage.judge(stage.init(), block, out.rows.y)
    assert equal((state, given), fold(stage, [block]))
    with pytest.raises(UsageError, match="state of its own"):
        Horizon(drive()).judge(Horizon(drive()).init(), block, block.y)


def test_new_parameters_are_state() -> None:
    stage, block = Horizon(drive(1.0), 1.0), drive_rows(4)
    state, first = stage.step(stage.init(), take(block, 0, 300))
    state = stage.renew(state, np.array([2.0]))
    state, second = stage.step(state, take(block, 300, 600))
    assert np.nanstd(second.rows.residual) > 5 * np.nanstd(first.rows.residual)


def test_a_failing_step_starts_anew() -> None:
    def step(x, u, dt, p):  # type: ignore[no-untyped-def]
        if u[0] > 1:
            raise ValueError("too fast")
        return ([x[0] + u[0] * dt],) * 2

    model = FunctionModel(step, Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
    u = np.full((8, 1), 0.5)
    u[4] = 3.0
    block = make_block(t=np.arange(8) * 10**9, u=u, y=np.arange(8)[:, None] * 0.5)
    state, out = fold(Horizon(model, 100.0), [block])
    assert np.flatnonzero(np.isnan(out.rows.y[:, 0])).tolist() == [0, 4]
    assert np.isfinite(state.x).all()
    np.testing.assert_array_equal(out.rows.residual[5:, 0], 0.0)


def test_a_segment_cut_by_a_gap_counts_when_half_a_horizon_long() -> None:
    for at, segments in ((16, 3), (13, 2)):
        block = drive_rows(1, n=27)
        block.gap[at] = True
        _, out = fold(Horizon(drive(), 1.0), [block])
        assert out.rows.end.sum() == segments, at


def test_what_overruled_is_adopted_at_once_and_not_compared() -> None:
    block = drive_rows(1, n=40)
    block.y[20:] += 1.0
    block.mark[20, 1] = Mark.OVERRULED
    _, out = fold(Horizon(drive(), 10.0), [block])
    assert np.isnan(out.rows.residual[20, 0])
    assert np.nanmax(np.abs(out.rows.residual)) < 0.1
    assert restarts(block, 10.0, np.zeros(1)).code[21] == 1


@pytest.mark.parametrize("horizon", [0.0, -1.0, np.nan])
def test_a_horizon_is_above_zero(horizon: float) -> None:
    with pytest.raises(UsageError, match="above 0 s"):
        Horizon(drive(), horizon)
    with pytest.raises(UsageError, match="above 0 s"):
        restarts(drive_rows(1, n=3), horizon, np.zeros(1))


def test_scale_is_checked() -> None:
    with pytest.raises(UsageError, match="1 numbers above 0"):
        Horizon(drive(), 1.0, scale=(0.0,))


def test_scale_is_the_unit_of_loss() -> None:
    blocks = [drive_rows(1)]
    (_, plain_), (_, scaled) = (fold(Horizon(drive(), 1.0, s), blocks) for s in ((1.0,), (0.1,)))
    np.testing.assert_allclose(scaled.rows.losses, 100 * plain_.rows.losses)
    assert concatenate([take(blocks[0], 0, 9), take(blocks[0], 9, 600)]).row == 0
