"""A few rows of a map are predicted alone, as they are among all others."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.config.spec import AnomalySpec, ModelSpec, TwinSpec
from evertwin.fold import Block, make_block
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.gauges.rows.reading import possible
from evertwin.models import FunctionModel, Parameters
from evertwin.setup.setup import Setup
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve

MAP = FunctionModel(
    lambda x, u, dt, p: ([], [p[0] * u[0], u[0] - u[1]]),
    Layout.of(load="N", drag="N"), Layout.of(power="W", rest="N"),
    parameters=Parameters.of(k=(2.0, "W/N")),
)  # fmt: skip
LAG = FunctionModel(
    lambda x, u, dt, p: ([p[0] * x[0] + u[0], 0.0], [x[0], u[1]]),
    Layout.of(load="N", drag="N"), Layout.of(power="W", rest="N"), Layout.of(a="1", b="1"),
    parameters=Parameters.of(k=(0.5, "1")),
)  # fmt: skip


def rows_of(model: FunctionModel, sizes: tuple[int, ...]) -> Rows:
    rng, blocks, row = np.random.default_rng(1), list[Block](), 0
    for task, n in enumerate(sizes):
        u = rng.uniform(1.0, 5.0, (n, 2))
        y = np.c_[2.2 * u[:, 0], u[:, 0] - u[:, 1]] + rng.normal(0.0, 0.1, (n, 2))
        y[rng.random((n, 2)) < 0.1] = np.nan
        blocks.append(make_block(t=np.arange(n) * 10**9, u=u, y=y, row=row, task=task))
        row += n
    setup = Setup(TwinSpec("map", ModelSpec("python"), anomaly=AnomalySpec(0.05)), model)
    problem = Problem(model, tuple(blocks))
    return Rows(setup, lambda some: Problem(model, some), tuple(blocks), problem, solve(problem),
                solve)  # fmt: skip


@pytest.mark.parametrize(("first", "stop"), [(0, 40), (60, 120), (95, 260), (210, 300), (0, 300)])
def test_a_part_of_a_map_is_off_as_among_all_rows(first: int, stop: int) -> None:
    rows, tried = rows_of(MAP, (100, 120, 80)), 0
    near, off = rows.of(first, stop)
    assert (off, near.count) == (first, stop - first)
    for one in possible(rows.setup, MAP):
        whole = rows.under(one, rows.changed(first, stop, one.undone))[first:stop]
        part = near.under(one, near.changed(first - off, stop - off, one.undone))
        assert np.array_equal(whole, part, equal_nan=True) and np.isfinite(part).any()
        known = np.isfinite(part)
        assert near.total(part, known) == rows.total(whole, known)
        tried += 1
    assert tried


def test_a_state_needs_the_rows_before_it() -> None:
    rows = rows_of(LAG, (100, 120))
    assert rows.of(30, 60) == (rows, 0)
