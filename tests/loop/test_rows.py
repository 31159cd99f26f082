"""One task's recorded channels become rows: derived channels, grid, filter, crop, held inputs."""

from __future__ import annotations

from dataclasses import replace

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
from evertwin.errors import ConfigError, DataError
from evertwin.fold import Block
from evertwin.loop.tasks import Series, rows_of_task
from evertwin.machines.mobile import Robot1D

SPEC = TwinSpec("robot", ModelSpec("robot1d"))
T = np.arange(200) * 10_000_000
SECONDS = T * 1e-9
RNG = np.random.default_rng(2)
A, B = RNG.normal(size=200), RNG.normal(size=200)


def rows(spec: TwinSpec, series: Series) -> Block:
    block = rows_of_task(series, spec, Robot1D(), 0, 0)
    assert block is not None
    return block


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
    derive = DeriveSpec("x", op, ("a", "b"), value=value)  # type: ignore[arg-type]
    block = rows(replace(SPEC, derive=(derive,)), {n: (T, c) for n, c in zip("abv", (A, B, A))})
    assert block.y[:, 0] == pytest.approx(expected)


@pytest.mark.parametrize(("op", "value"), [("derivative", 0.0), ("slope", 0.05)])
def test_derivatives_of_a_cubic(op: str, value: float) -> None:
    curve = SECONDS**3 - 2.0 * SECONDS
    derive = DeriveSpec("x", op, ("a",), value=value)  # type: ignore[arg-type]
    block = rows(replace(SPEC, derive=(derive,)), {"a": (T, curve), "v": (T, A)})
    inner = slice(2, -2)
    exact = 3.0 * SECONDS**2 - 2.0
    # central differences of a cubic are off by h²
    bound = 1.1e-4 if op == "derivative" else 1e-9
    assert np.abs(block.y[:, 0] - exact)[inner].max() < bound


def test_a_slope_needs_enough_rows() -> None:
    derive = DeriveSpec("x", "slope", ("a",), value=0.01)
    with pytest.raises(ConfigError, match="a cubic needs 5 to 200"):
        rows(replace(SPEC, derive=(derive,)), {"a": (T, A), "v": (T, A)})


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
    spec = replace(SPEC, clock=ClockSpec(rate=50.0))
    with pytest.raises(DataError, match="do not overlap in time"):
        rows(spec, {"v": (T, A), "x": (T + 10**12, A)})


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
    with pytest.raises(ConfigError, match=r"needs a \[clock\] rate"):
        rows(replace(spec, clock=ClockSpec()), {"v": (T, noisy), "x": (T, A)})


def test_a_crop_keeps_from_the_first_to_the_last_motion() -> None:
    v = np.where((SECONDS > 0.5) & (SECONDS < 1.5), 1.0, 0.0)
    crop = CropSpec(("v",), above=0.5, inside=0.095)
    spec = replace(SPEC, clock=ClockSpec(crop=crop))
    block = rows(spec, {"v": (T, v), "x": (T, A)})
    assert block.t[0] * 1e-9 == pytest.approx(0.61) and block.t[-1] * 1e-9 == pytest.approx(1.39)
    still = rows_of_task({"v": (T, 0.0 * v), "x": (T, A)}, spec, Robot1D(), 0, 0)
    assert still is None


def test_start_and_stop_cut_the_task() -> None:
    spec = replace(SPEC, clock=ClockSpec(start=0.2, stop=0.4))
    block = rows(spec, {"v": (T, A), "x": (T, B)})
    assert len(block.t) == 21 and np.array_equal(block.y[:, 0], B[20:41])


def test_a_command_acts_from_its_stamp_on() -> None:
    commands = np.array([0, 5, 10]) * 10_000_000
    block = rows(SPEC, {"v": (commands, np.array([1.0, 2.0, 3.0])), "x": (T[:13], B[:13])})
    assert block.u[:, 0].tolist() == [1.0] * 6 + [2.0] * 5 + [3.0] * 2
    measured = replace(SPEC, signals={"v": SignalSpec(hold=False)})
    block = rows(measured, {"v": (commands, np.array([1.0, 2.0, 3.0])), "x": (T[:11], B[:11])})
    assert block.u[:, 0] == pytest.approx(np.linspace(1.0, 3.0, 11))


def test_a_missing_channel_is_named_with_those_that_there_are() -> None:
    with pytest.raises(ConfigError, match=r"channel 'x' is neither recorded nor derived.*v, speed"):
        rows(SPEC, {"v": (T, A), "speed": (T, B)})
    spec = replace(SPEC, signals={"x": SignalSpec(source="speed")})
    assert np.array_equal(rows(spec, {"v": (T, A), "speed": (T, B)}).y[:, 0], B)


def test_a_long_interval_is_marked_as_a_gap() -> None:
    late = T.copy()
    late[100:] += 10**9
    block = rows(replace(SPEC, clock=ClockSpec(gap=0.5)), {"v": (late, A), "x": (late, B)})
    assert np.flatnonzero(block.gap).tolist() == [0, 100]
