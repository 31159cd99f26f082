"""Recursive tuning: the laws of a stage, agreement with the batch, memory, trust."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evertwin.errors import UsageError
from evertwin.fold import check_online, fold, make_block
from evertwin.tuning import ClosedForm, Recursive
from evertwin.tuning.stream.recursive import RecursiveRows
from evertwin.tuning.stream.recursive_loop import learn, solve_information

P = np.array([3.0, 1.0, 2.0, 4.0, 0.02])


def stream(model: Any, measured: Any, n: int = 200, seed: int = 0) -> Any:
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(n, 2))
    return measured(model, u, P, 0.1 * rng.normal(size=u.shape))


@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(cuts=st.sets(st.integers(1, 199), max_size=6), every=st.sampled_from([1, 7, 10]))
def test_the_partition_law_holds(axes: Any, measured: Any, cuts: set[int], every: int) -> None:
    model = axes(2, sigma=2.0)
    block = stream(model, measured)
    stage = Recursive(model, scale=(0.1, 0.1), memory=5.0, every=every, moving=((1, 1, 0.5),))
    check_online(stage, block, [tuple(sorted(cuts))])


def test_the_last_estimate_equals_the_batch(axes: Any, measured: Any) -> None:
    model = axes(2, sigma=2.0)
    block = stream(model, measured)
    stage = Recursive(model, scale=(0.1, 0.1))
    state, _ = fold(stage, [block])
    # One row more is a beat: the estimate of all rows before it.
    last = make_block(t=[block.t[-1] + 1], u=[[0.0, 0.0]], y=[[0.0, 0.0]], row=len(block.t),
                      before=int(block.t[-1]))  # fmt: skip
    state, _ = stage.step(state, last)
    values, sigma = stage.estimate(state)
    y0, phi = model.regressor(None, block.u, block.dt, model.parameters.values)
    r = block.y - y0 - (phi * model.parameters.values[model.columns]).sum(axis=2)
    batch = replace(ClosedForm.of(model), noise=np.full(2, 0.1)).solve(r, phi)
    np.testing.assert_allclose(values, batch.values, rtol=1e-10)
    np.testing.assert_allclose(sigma, np.sqrt(np.diag(batch.covariance)), rtol=1e-10)


def test_it_predicts_first_and_learns_then(axes: Any, measured: Any) -> None:
    model = axes(2, sigma=5.0)
    block = stream(model, measured)
    _, out = fold(Recursive(model, scale=(0.1, 0.1), every=50), [block])
    used = out.rows.values[:, 0]
    assert np.unique(used[:50]).tolist() == [1.0]
    assert len(np.unique(used)) == 4
    early, late = (
        np.sqrt(np.mean(out.rows.residual[s] ** 2)) for s in (slice(50), slice(150, 200))
    )
    assert late < 0.15 < early


def test_memory_follows_a_drift_and_falls_back_to_the_prior(axes: Any, measured: Any) -> None:
    model = axes(1, sigma=2.0)
    rng = np.random.default_rng(3)
    u = rng.normal(size=(600, 1))
    first = measured(model, u[:300], np.array([3.0, 2.0, 0.02]), 0.0)
    second = measured(model, u[300:], np.array([5.0, 2.0, 0.02]), 0.0)
    y = np.concatenate([first.y, second.y])
    u = np.concatenate([u, np.zeros((2000, 1))])
    y = np.concatenate([y, np.zeros((2000, 1))])
    block = make_block(t=np.arange(2600) * 10**8, u=u, y=y)
    _, out = fold(Recursive(model, scale=(0.1,), memory=3.0), [block])
    values = out.rows.values[:, 0]
    assert values[299] == pytest.approx(3.0, abs=0.02)
    assert values[599] == pytest.approx(5.0, abs=0.05)
    assert values[-1] == pytest.approx(1.0, abs=1e-6)  # nothing seen for long: the prior


def test_without_a_prior_nothing_is_claimed_before_there_is_enough(
    axes: Any, measured: Any
) -> None:
    model = axes(1)
    block = measured(model, np.full((20, 1), 0.4), np.array([3.0, 2.0, 0.02]), 0.0)
    stage = Recursive(model)
    state, out = fold(stage, [block])
    assert np.unique(out.rows.values).tolist() == [1.0]  # one speed cannot tell two parameters
    assert np.isinf(stage.estimate(state)[1]).all()


def test_what_is_not_trusted_never_enters(axes: Any, measured: Any) -> None:
    model = axes(2, sigma=2.0)
    block = stream(model, measured)
    y, mark = block.y.copy(), block.mark.copy()
    y[50:60, 0], mark[50:60, 2] = 1e6, 4
    y[70, 1], mark[70, 3] = np.nan, 1
    dirty = block._replace(y=y, mark=mark)
    state, out = fold(Recursive(model, scale=(0.1, 0.1)), [dirty])
    assert np.abs(state.p - P)[:4].max() < 0.1
    assert np.isnan(out.rows.residual[50:60, 0]).all()


def test_misuse_is_refused(axes: Any) -> None:
    with pytest.raises(UsageError, match="every ≥ 1"):
        Recursive(axes(1), every=0)
    with pytest.raises(UsageError, match="expected 1 numbers"):
        Recursive(axes(1), scale=(1.0, 2.0))
    with pytest.raises(UsageError, match="width: the outputs are not linear"):
        Recursive(axes(1), ("width",))


def test_kernels_equal_their_plain_twins_bit_for_bit(axes: Any, measured: Any) -> None:
    model = axes(2, sigma=2.0)
    block = stream(model, measured, 40)
    stage = Recursive(model, scale=(0.1, 0.2), memory=2.0, every=3, moving=((0, 0, 0.3),))
    y0, phi = model.regressor(None, block.u, block.dt, model.parameters.values)
    results = []
    for kernel in (learn.compiled, learn.plain):
        state = stage.init()
        rows = RecursiveRows(np.empty((40, 2)), np.empty((40, 2)), np.empty((40, 4)))
        given = block.dt, block.u, block.y, block.mark
        kernel(block.row, given, (y0, phi), stage.fixed, state, rows)
        results.append((*state, *rows))
    for left, right in zip(*results, strict=True):
        assert np.array_equal(left, right, equal_nan=True)
    singular = np.zeros((2, 2)), np.zeros(2), np.zeros(2), np.zeros(2)
    assert not solve_information.plain(*singular)
    twice = [np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([1.0, 2.0])]
    outs = [(np.zeros(2), np.zeros(2)) for _ in range(2)]
    assert solve_information.compiled(*twice, *outs[0])
    assert solve_information.plain(*twice, *outs[1])
    assert np.array_equal(outs[0], outs[1])
