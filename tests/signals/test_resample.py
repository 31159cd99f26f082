"""Resampling: exact on lines, silent over gaps, right over the wrap of an angle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evertwin.errors import DataError, UsageError
from evertwin.signals import Layout
from evertwin.signals.resample import linear, uniform
from evertwin.signals.series import Series

EPOCH = 1_614_859_007_119_846_022
times = st.lists(st.integers(1, 10**8), min_size=2, max_size=50).map(np.cumsum)


@given(times, st.integers(10**5, 10**8))
def test_straight_lines_stay_straight(steps: np.ndarray, period: int) -> None:
    t = EPOCH + steps
    v = ((t - EPOCH) * 1e-9)[:, None]
    grid = uniform(int(t[0]), int(t[-1]), period)
    out = linear(t, v, grid, longest=10**9)
    np.testing.assert_allclose(out[:, 0], (grid - EPOCH) * 1e-9, atol=1e-12)


def test_outside_is_absent() -> None:
    t, v = np.array([10, 20]), np.array([[1.0], [2.0]])
    assert np.isnan(linear(t, v, np.array([5, 25]), 100)).all()
    nothing = np.full((2, 1), np.nan)
    assert np.isnan(linear(t, nothing, t, 100)).all()


def test_misuse() -> None:
    with pytest.raises(UsageError, match="period"):
        uniform(0, 10, 0)
    one = Series(Layout.of(v="m"), np.array([1]), np.zeros((1, 1)))
    assert one.period == 0


def test_series_is_checked_when_built() -> None:
    layout = Layout.of(v="m")
    with pytest.raises(DataError, match="row 2"):
        Series(layout, np.array([0, 5, 5]), np.zeros((3, 1)))
    with pytest.raises(DataError, match="shape"):
        Series(layout, np.array([0, 5]), np.zeros((2, 2)))


def test_series_parts() -> None:
    t = EPOCH + np.arange(4) * 10**9
    series = Series(Layout.of(a="m", b="s"), t, np.arange(8.0).reshape(4, 2))
    assert series.select(["b"]).v[:, 0].tolist() == [1.0, 3.0, 5.0, 7.0]
    assert series.seconds.tolist() == [0.0, 1.0, 2.0, 3.0]
