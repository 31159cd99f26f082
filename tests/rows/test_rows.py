"""Samples of recorded channels become rows: derived channels, grid, filter, crop, held inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from evertwin.config.spec import (
    ClockSpec,
    CropSpec,
    DeriveSpec,
    FilterSpec,
    ModelSpec,
    SignalSpec,
    TwinSpec,
)
from evertwin.errors import ConfigError, DataError, UsageError
from evertwin.fold import Block, Chunk, Mark, concatenate, copy, make_block, take
from evertwin.machines.mobile import Robot1D
from evertwin.rows.alignment import Alignment
from evertwin.rows.crop import cropped
from evertwin.rows.feed import Feed
from evertwin.rows.ring import Ring
from evertwin.sources.merging import merge
from evertwin.sync import Feed as Brings

Series = Mapping[str, tuple[np.ndarray, np.ndarray]]
SPEC = TwinSpec("robot", ModelSpec("robot1d"))
T = np.arange(200) * 10_000_000
SECONDS = T * 1e-9
RNG = np.random.default_rng(2)
A, B = RNG.normal(size=200), RNG.normal(size=200)


def rows(spec: TwinSpec, series: Series) -> Block:
    """The rows of channels, each a source of its own."""
    way = Alignment.of(spec, Robot1D(), [Brings(name, (name,)) for name in series])
    state, found = way.init(), []
    for name, (t, v) in series.items():
        state, block, _ = way.step(state, Chunk(name, t.astype(np.int64), v[:, None].astype(float)))
        found.append(block)
    found.append(way.flush(state)[1])
    return concatenate([block for block in found if block is not None])


@pytest.mark.parametrize(
    ("op", "value", "expected"),
    [
        ("sum", 0.0, A + B),
        ("mean", 0.0, (A + B) / 2),
        ("difference", 0.0, A - B),
        ("product", 0.0, A * B),
        ("scale", 3.0, 3.0 * A),
        ("norm", 0.0, np.hypot(A, B)),
        ("max", 0.0, np.maximum(np.abs(A), np.abs(B))),
        ("middle", 0.0, np.r_[A[0], (A[1:] + A[:-1]) / 2]),
    ],
)
def test_a_derived_channel_is_what_its_operation_says(
    op: str, value: float, expected: np.ndarray
) -> None:
    sources = ("a",) if op in ("scale", "middle") else ("a", "b")
    derive = DeriveSpec("x", op, sources, value=value)  # type: ignore[arg-type]
    block = rows(replace(SPEC, derive=(derive,)), {n: (T, c) for n, c in zip("abv", (A, B, A))})
    assert block.y[:, 0] == pytest.approx(expected)


def test_an_operation_says_how_many_channels_it_takes() -> None:
    derive = DeriveSpec("x", "scale", ("a", "b"))
    with pytest.raises(ConfigError, match="scale takes 1 channels in 'from', got 2"):
        rows(replace(SPEC, derive=(derive,)), dict.fromkeys("abv", (T, A)))


@pytest.mark.parametrize(("op", "value"), [("derivative", 0.0), ("slope", 0.05)])
def test_derivatives_of_a_cubic(op: str, value: float) -> None:
    curve = SECONDS**3 - 2.0 * SECONDS
    derive = DeriveSpec("x", op, ("a",), value=value)  # type: ignore[arg-type]
    spec = replace(SPEC, derive=(derive,), clock=ClockSpec(rate=100.0))
    block = rows(spec, {"a": (T, curve), "v": (T, A)})
    inner = slice(2, -2) if op == "derivative" else slice(None)
    exact = 3.0 * SECONDS**2 - 2.0
    # central differences of a cubic are off by h²
    bound = 1.1e-4 if op == "derivative" else 1e-9
    assert np.abs(block.y[:, 0] - exact)[inner].max() < bound


@pytest.mark.parametrize(
    ("value", "rate", "said"), [(0.01, 100.0, "needs 5 to 4097"), (1.0, None, "clock. rate")]
)
def test_a_slope_needs_enough_rows_at_a_rate(value: float, rate: float | None, said: str) -> None:
    derive = DeriveSpec("x", "slope", ("a",), value=value)
    with pytest.raises(UsageError, match=said):
        spec = replace(SPEC, derive=(derive,), clock=ClockSpec(rate=rate))
        rows(spec, {"a": (T, A), "v": (T, A)})


def test_a_grid_interpolates_and_leaves_gaps_out() -> None:
    late = np.delete(T, slice(100, 150))
    spec = replace(SPEC, clock=ClockSpec(rate=50.0, gap=0.1))
    block = rows(spec, {"v": (T, A), "x": (late, 2.0 * late * 1e-9)})
    assert np.allclose(np.diff(block.t), 20_000_000)
    known = np.isfinite(block.y[:, 0])
    assert block.y[known, 0] == pytest.approx(2e-9 * block.t[known])
    inside = (block.t > T[99]) & (block.t < T[150])
    assert inside.any() and not known[inside].any() and known[~inside].all()


def test_sources_that_do_not_overlap_are_refused() -> None:
    chunk = Chunk("x", T + 10**12, B[:, None])
    with pytest.raises(DataError, match="do not overlap in time"):
        list(merge([iter([Chunk("v", T, A[:, None])]), iter([chunk])]))


def test_a_filtered_input_has_lost_its_noise() -> None:
    slow = np.sin(2 * np.pi * SECONDS)
    noisy = slow + 0.2 * np.sin(2 * np.pi * 40.0 * SECONDS)
    rule = FilterSpec(cutoff=8.0, inputs=("v",))
    spec = replace(
        SPEC, clock=ClockSpec(rate=100.0), filter=rule, signals={"v": SignalSpec(hold=False)}
    )
    block = rows(spec, {"v": (T, noisy), "x": (T, A)})
    inner = slice(30, -30)
    assert np.abs(block.u[:, 0] - slow)[inner].max() < 0.01
    # what a filter makes of an end is compared with nothing
    ends = np.isnan(block.y[:, 0])
    assert ends[:30].all() and ends[-30:].all() and not ends[60:-60].any()
    with pytest.raises(ConfigError, match=r"set rate in \[clock\]"):
        rows(replace(spec, clock=ClockSpec()), {"v": (T, noisy), "x": (T, A)})


def test_a_crop_keeps_from_the_first_to_the_last_motion() -> None:
    v = np.where((SECONDS > 0.5) & (SECONDS < 1.5), 1.0, 0.0)
    crop = CropSpec(("v",), above=0.5, inside=0.095)
    spec = replace(SPEC, clock=ClockSpec(crop=crop))
    (block,) = Feed(spec, Robot1D()).blocks({"t": SECONDS, "v": v, "x": A})
    # a command acts over the interval that follows its stamp
    assert block.t[0] * 1e-9 == pytest.approx(0.62) and block.t[-1] * 1e-9 == pytest.approx(1.4)
    whole = rows(spec, {"v": (T, 0.0 * v), "x": (T, A)})
    assert len(whole.t) == 200 and cropped(whole, spec, Robot1D()) is None


def test_start_and_stop_cut_the_task() -> None:
    spec = replace(SPEC, clock=ClockSpec(start=0.2, stop=0.4))
    block = rows(spec, {"v": (T, A), "x": (T, B)})
    assert len(block.t) == 21 and np.array_equal(block.y[:, 0], B[20:41])
    assert block.dt[0] == 0.0 and block.gap.tolist() == [True] + [False] * 20


def test_a_command_acts_from_its_stamp_on() -> None:
    commands = np.array([0, 5, 12]) * 10_000_000
    series = {"v": (commands, np.array([1.0, 2.0, 3.0])), "x": (T[:13], B[:13])}
    assert rows(SPEC, series).u[:, 0].tolist() == [1.0] * 6 + [2.0] * 7
    measured = replace(SPEC, signals={"v": SignalSpec(hold=False)})
    line = rows(measured, series).u[:, 0]
    assert line == pytest.approx(np.r_[np.linspace(1.0, 2.0, 6), 2.0 + np.arange(1, 8) / 7])


def test_a_derived_command_acts_from_its_stamp_on() -> None:
    spec = replace(SPEC, derive=(DeriveSpec("v", "scale", ("a",), value=2.0),))
    block = rows(spec, {"a": (T, A), "x": (T, B)})
    assert np.array_equal(block.u[:, 0], np.r_[2 * A[0], 2 * A[:-1]])


def test_a_missing_channel_is_named_with_those_that_there_are() -> None:
    with pytest.raises(ConfigError, match=r"channel 'x' is neither recorded nor derived.*speed, v"):
        rows(SPEC, {"v": (T, A), "speed": (T, B)})
    spec = replace(SPEC, signals={"x": SignalSpec(source="speed")})
    assert np.array_equal(rows(spec, {"v": (T, A), "speed": (T, B)}).y[:, 0], B)


def test_a_long_interval_is_marked_as_a_gap() -> None:
    late = T.copy()
    late[100:] += 10**9
    block = rows(replace(SPEC, clock=ClockSpec(gap=0.5)), {"v": (late, A), "x": (late, B)})
    assert np.flatnonzero(block.gap).tolist() == [0, 100]


def derived(op: str, x: list[float], heading: float) -> list[float]:
    n = len(x)
    t = np.arange(n, dtype=np.int64) * 10**9
    spec = replace(SPEC, derive=(DeriveSpec("x", op, ("px", "py", "a")),))  # type: ignore[arg-type]
    series = {"px": np.array(x), "py": np.zeros(n), "a": np.full(n, heading), "v": np.zeros(n)}
    return list(rows(spec, {name: (t, v) for name, v in series.items()}).y[:, 0])


def test_along_counts_forwards_and_backwards() -> None:
    assert derived("along", [0.0, 1.0, 0.5], 0.0) == pytest.approx([0.0, 1.0, 0.5])
    assert derived("along", [0.0, 1.0], np.pi) == pytest.approx([0.0, -1.0])


def test_way_is_the_length_of_the_path_with_the_sign_of_each_step() -> None:
    assert derived("way", [0.0, 1.0, 0.5], 0.0) == pytest.approx([0.0, 1.0, 0.5])
    assert derived("way", [0.0, -1.0, -1.5], 0.0) == pytest.approx([0.0, -1.0, -1.5])


def test_path_is_its_length_with_the_sign_of_the_whole() -> None:
    assert derived("path", [0.0, 1.0, 0.5], 0.0) == pytest.approx([0.0, 1.0, 1.5])
    assert derived("path", [0.0, 0.5, -1.0], 0.0) == pytest.approx([0.0, 0.5, -2.0])


def test_rows_are_handed_on_to_a_run_at_another_rate() -> None:
    rows = make_block(t=range(10), u=[[float(k)] for k in range(10)], y=[[0.0]] * 10)
    old = Ring(capacity=6, nu=1, ny=1)
    kept = old.push(old.init(), rows)
    for capacity in (4, 6, 9):
        new = Ring(capacity=capacity, nu=1, ny=1)
        handed = new.handed_on(copy(kept))
        found = new.between(handed, -20, 0)
        values = [value for one in found for value in one.u.ravel().tolist()]
        assert values == [float(k) for k in range(10 - min(capacity, 6), 10)]
        again = new.push(handed, rows)
        assert new.between(again, 0, 10)[-1].u[-1, 0] == 9.0


@pytest.mark.parametrize("cuts", [(), (1,), (3, 4, 9), (2, 11), tuple(range(1, 15))])
def test_the_range_of_rows_that_are_kept_no_longer_does_not_depend_on_cuts(
    cuts: tuple[int, ...],
) -> None:
    u = np.array([4.0, -9.0, np.nan, 3.0, 7.0, 50.0, 5.0, 6.0, -1.0, *np.arange(10.0, 16.0)])[
        :, None
    ]
    rows = make_block(t=range(15), u=u, y=np.zeros((15, 1)))
    rows.mark[5, 0] = Mark.ERROR
    ring = Ring(capacity=6, nu=1, ny=1)
    kept = ring.init()
    for a, b in pairwise((0, *cuts, 15)):
        kept = ring.push(kept, take(rows, a, b))
    assert kept.seen[0].ravel().tolist() == [-9.0, 7.0]
    assert np.isinf(kept.seen[1]).all()
    assert ring.handed_on(copy(kept)).seen.tolist() == kept.seen.tolist()
