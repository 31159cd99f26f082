"""Resampling: exact on lines, silent over gaps, right over the wrap of an angle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evertwin.errors import DataError, UsageError
from evertwin.signals import Channel, Layout
from evertwin.signals.resample import hold, linear, resample, uniform
from evertwin.signals.series import Series, moving_span

EPOCH = 1_614_859_007_119_846_022
times = st.lists(st.integers(1, 10**8), min_size=2, max_size=50).map(np.cumsum)


@given(times, st.integers(10**5, 10**8))
def test_straight_lines_stay_straight(steps: np.ndarray, period: int) -> None:
    t = EPOCH + steps
    v = ((t - EPOCH) * 1e-9)[:, None]
    grid = uniform(int(t[0]), int(t[-1]), period)
    out = linear(t, v, grid, longest=10**9)
    np.testing.assert_allclose(out[:, 0], (grid - EPOCH) * 1e-9, atol=1e-12)
    kept = hold(t, v, grid, longest=10**9)[:, 0]
    newest = np.searchsorted(t, grid, side="right") - 1
    assert (kept == v[newest, 0]).all()


def test_gaps_and_absent_values_are_not_bridged() -> None:
    t = np.array([0, 10, 20, 100, 110, 120])
    v = np.array([[0.0], [1.0], [np.nan], [10.0], [11.0], [12.0]])
    out = resample(Series(Layout.of(v="m"), t, v), 10, longest=30)
    y = out.series.v[:, 0]
    assert y[[0, 1, 10, 11, 12]].tolist() == [0.0, 1.0, 10.0, 11.0, 12.0]
    assert np.isnan(y[2:10]).all()
    assert np.flatnonzero(out.gap).tolist() == [10]


def test_angles_take_the_short_way() -> None:
    t = np.array([0, 10, 20])
    v = np.radians([[178.0], [-178.0], [-170.0]])
    layout = Layout((Channel("yaw", "rad", kind="angle"),))
    out = np.degrees(resample(Series(layout, t, v), 5).series.v[:, 0])
    np.testing.assert_allclose(out, [178, 180, 182, 186, 190])


def test_commands_are_held() -> None:
    t = np.array([0, 10, 20])
    series = Series(Layout.of(u="m", y="m"), t, np.array([[0.0, 0.0], [2.0, 2.0], [4.0, 4.0]]))
    out = resample(series, 5, held=("u",)).series
    assert out.column("u").tolist() == [0.0, 0.0, 2.0, 2.0, 4.0]
    assert out.column("y").tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_outside_is_absent() -> None:
    t, v = np.array([10, 20]), np.array([[1.0], [2.0]])
    assert np.isnan(linear(t, v, np.array([5, 25]), 100)).all()
    assert np.isnan(hold(t, v, np.array([5]), 100)).all()
    nothing = np.full((2, 1), np.nan)
    assert np.isnan(linear(t, nothing, t, 100)).all() and np.isnan(hold(t, nothing, t, 100)).all()


def test_misuse() -> None:
    with pytest.raises(UsageError, match="period"):
        uniform(0, 10, 0)
    one = Series(Layout.of(v="m"), np.array([1]), np.zeros((1, 1)))
    with pytest.raises(DataError, match="at least 2 rows"):
        resample(one, 10)
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
    wider = series.with_channel(Channel("c", "1"), np.ones(4))
    assert wider.layout.names == ("a", "b", "c") and wider.column("c").tolist() == [1.0] * 4


def test_moving_span() -> None:
    t = np.arange(100) * 10**7
    speed = np.zeros((100, 2))
    speed[20:80, 1] = -0.5
    assert moving_span(t, speed, 0.1) == (t[20], t[79])
    assert moving_span(t, speed, 0.1, inside=3 * 10**7) == (t[23], t[76])
    assert moving_span(t, speed, 1.0) is None
    assert moving_span(t, speed, 0.1, inside=10**9) is None
