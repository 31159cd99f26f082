"""Computed channels: the compiled loop is its plain-Python twin, bit for bit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy

from evertwin.errors import ConfigError
from evertwin.fold.state import equal
from evertwin.signals.fir import Symmetric
from evertwin.sync.alignment.align import Rows
from evertwin.sync.alignment.derive import Derive, Operation, Taken

LOW = Symmetric.butterworth(20.0, 100.0)
ALL = (
    Operation("x", "filter", ("x",), low_pass=LOW),
    Operation("v", "derivative", ("x",)),
    Operation("a", "slope", ("v",), value=0.1),
    Operation("m", "middle", ("x",)),
    Operation("along", "along", ("x", "y", "z")),
    Operation("way", "way", ("x", "y", "z")),
    *(Operation(op, op, ("x", "y")) for op in ("sum", "mean", "difference", "product", "norm")),
    Operation("max", "max", ("x", "y", "z")),
    Operation("scale", "scale", ("z",), value=3.0),
    Operation("whole", "unwrap", ("y",)),
    Operation("late", "lag", ("y",), value=0.03),
)
OUTPUTS = (*(Taken(one.name) for one in ALL), Taken(None))
DERIVE = Derive(("u", "x", "y", "z"), ALL, (Taken("u", "held"), Taken("z", "step")), OUTPUTS, 100.0)


def rows(seed: int, n: int = 300) -> Rows:
    rng = np.random.default_rng(seed)
    gap = rng.random(n) < 0.02
    gap[[0, n // 2]] = True
    steps = np.where(gap, 10**9, 10**7)
    v = rng.normal(size=(n, 4))
    v[rng.random((n, 4)) < 0.02] = np.nan
    mark = np.where(np.isnan(v), np.uint8(1), np.uint8(0))
    task = (np.arange(n) >= n // 2).astype(np.int64)
    return Rows(np.arange(n), np.cumsum(steps), steps * 1e-9, v[:, :1], v[:, 1:], mark, task, gap)


def folded(seed: int) -> list[Rows | None]:
    state, first, _ = DERIVE.step(DERIVE.init(), rows(seed))
    return [first, DERIVE.flush(state)[1]]


def test_compiled_rows_are_those_of_plain_python(run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    compiled = tuple(tuple(folded(seed)) for seed in range(3))
    run_as("plain")
    assert equal(compiled, tuple(tuple(folded(seed)) for seed in range(3)))


def test_every_row_leaves_once() -> None:
    parts = [part for part in folded(7) if part is not None]
    assert np.concatenate([part.number for part in parts]).tolist() == list(range(300))


def test_a_column_that_is_not_there_is_named() -> None:
    with pytest.raises(ConfigError, match=r"'nothing' is neither recorded nor derived: .* x, y"):
        Derive(("x", "y"), (Operation("z", "sum", ("nothing",)),), (), ()).init()


def test_an_angle_goes_on_where_it_was_cut() -> None:
    turned = np.cumsum(np.random.default_rng(0).uniform(-2.0, 2.5, 200))
    cut = np.where(np.arange(200) % 9 == 4, np.nan, (turned + np.pi) % (2 * np.pi) - np.pi)
    t = np.arange(200) * 10**7
    given = Rows(
        np.arange(200), t, np.full(200, 0.01), np.zeros((200, 0)), cut[:, None],
        np.isnan(cut).astype(np.uint8)[:, None], np.zeros(200, np.int64), t == 0,
    )  # fmt: skip
    stage = Derive(("q",), (Operation("whole", "unwrap", ("q",)),), (), (Taken("whole"),))
    found = stage.step(stage.init(), given)[1].y[:, 0]
    known = ~np.isnan(cut)
    known[np.flatnonzero(~known) + 1] = False  # two steps at once may be more than half a turn
    assert (np.isnan(found) == np.isnan(cut)).all()
    off = (found - turned)[known] / (2 * np.pi)
    np.testing.assert_allclose(off, np.round(off), atol=1e-9)
    np.testing.assert_allclose(off[:3], off[0], atol=1e-9)


def test_a_lag_is_a_first_order_low_pass_that_begins_anew_behind_a_gap() -> None:
    rng, dt, constant = np.random.default_rng(4), 0.01, 0.025
    x, t = np.cumsum(rng.normal(size=300)), np.arange(300) * 10**7
    gap = np.isin(np.arange(300), (0, 200))
    given = Rows(
        np.arange(300), t, np.full(300, dt), np.zeros((300, 0)), x[:, None],
        np.zeros((300, 1), np.uint8), np.zeros(300, np.int64), gap,
    )  # fmt: skip
    stage = Derive(("x",), (Operation("x", "lag", ("x",), value=constant),), (), (Taken("x"),))
    state, left, _ = stage.step(stage.init(), given)
    found = np.concatenate([left.y[:, 0], *(p.y[:, 0] for p in (stage.flush(state)[1],) if p)])
    stay = np.exp(-dt / constant)
    for part in (slice(0, 200), slice(200, 300)):
        start = [stay * x[part][0]]
        want = scipy.signal.lfilter([1.0 - stay], [1.0, -stay], x[part], zi=start)[0]
        np.testing.assert_allclose(found[part], want, rtol=1e-12)
