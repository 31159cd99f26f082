"""Filters against their definitions, and the streamed filter against the one over whole windows."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal
from evertwin.signals.smooth import Smooth
from evertwin.signals.smooth_kernel import slide
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import DataError, UsageError
from evertwin.fold import Block, Mark, check_online, fold, make_block, take
from evertwin.signals.filters import Butterworth, SavitzkyGolay, by_segment

RNG = np.random.default_rng(0)
PERIOD = 10_000_000


def sine(frequency: float, n: int = 2000) -> np.ndarray:
    return np.sin(2 * np.pi * frequency * np.arange(n) / 100)[:, None]


@pytest.mark.parametrize("order", [1, 2, 4, 5])
def test_butterworth_gain_and_phase(order: int) -> None:
    low_pass = Butterworth(cutoff=5.0, rate=100.0, order=order)
    for frequency in (1.0, 5.0, 12.0):
        x = sine(frequency)
        y = low_pass(x)
        # Analogue prototype, warped by the bilinear transform, passed twice.
        warped = np.tan(np.pi * frequency / 100) / np.tan(np.pi * 5 / 100)
        gain = 1 / (1 + warped ** (2 * order))
        middle = slice(500, 1500)
        np.testing.assert_allclose(y[middle], gain * x[middle], atol=2e-3)


def test_butterworth_is_scipys() -> None:
    x = RNG.normal(size=(300, 3))
    b, a = scipy.signal.butter(4, 5.0, fs=100.0)
    reference = scipy.signal.filtfilt(b, a, x, axis=0)
    np.testing.assert_allclose(Butterworth(5.0, 100.0)(x), reference, atol=1e-9)


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_savgol_is_exact_on_its_polynomials(derivative: int) -> None:
    t = np.arange(80) / 100
    coefficients = np.array([0.3, -2.0, 5.0, -7.0])
    x = np.polynomial.polynomial.polyval(t, coefficients)
    truth = np.polynomial.polynomial.polyval(
        t, np.polynomial.polynomial.polyder(coefficients, derivative)
    )
    smooth = SavitzkyGolay(11, 100.0, degree=3, derivative=derivative)
    np.testing.assert_allclose(smooth(x[:, None])[:, 0], truth, atol=1e-7)


def test_misuse() -> None:
    for cutoff in (0.0, 50.0, -1.0):
        with pytest.raises(UsageError, match="cut-off"):
            Butterworth(cutoff, 100.0)
    for window, degree in ((10, 2), (5, 5), (3, -1)):
        with pytest.raises(UsageError, match="odd window"):
            SavitzkyGolay(window, 100.0, degree)
    with pytest.raises(DataError, match="at least 16 rows, got 3"):
        Butterworth(5.0, 100.0)(np.zeros((3, 1)))
    spoilt = np.zeros((50, 1))
    spoilt[17] = np.nan
    with pytest.raises(DataError, match="row 17"):
        Butterworth(5.0, 100.0)(spoilt)


def test_segments_do_not_see_each_other() -> None:
    low_pass = Butterworth(5.0, 100.0)
    v = RNG.normal(size=(200, 2))
    v[60] = np.nan
    gap = np.zeros(200, dtype=np.bool_)
    gap[[120, 190]] = True
    out = by_segment(low_pass, v, gap, low_pass.shortest)
    for a, b in ((0, 60), (61, 120), (120, 190)):
        assert (out[a:b] == low_pass(v[a:b])).all()
    assert np.isnan(out[60]).all() and np.isnan(out[190:]).all()


STAGE = Smooth(SavitzkyGolay(7, 100.0, derivative=1), (0, 2), 1, 2)


def block(seed: int, n: int = 60) -> Block:
    """Rows with gaps, uneven intervals, absent and infinite values."""
    rng = np.random.default_rng(seed)
    steps = np.full(n, PERIOD)
    steps[rng.integers(1, n, 2)] *= rng.integers(1, 4, 2)
    y = rng.normal(size=(n, 2))
    y[rng.integers(0, n, 2), 1] = np.nan
    task = np.cumsum(rng.random(n) < 0.03)
    return make_block(np.cumsum(steps), rng.normal(size=(n, 1)), y, task=task)


def test_streamed_equals_whole_window() -> None:
    n = 200
    x = RNG.normal(size=(n, 2))
    whole = make_block(np.arange(n) * PERIOD, RNG.normal(size=(n, 1)), x)
    state, out = fold(STAGE, [whole])
    rows = out.rows.block()
    m = STAGE.filter.delay
    assert len(rows.t) == n - m and rows.row == 0
    expected = STAGE.filter(x[:, 1:])[m : n - m, 0]
    np.testing.assert_allclose(rows.y[m:, 1], expected, atol=1e-10)
    assert np.isnan(rows.y[:m, 1]).all() and (rows.mark[:m, 2] == Mark.ABSENT).all()
    assert (rows.y[:, 0] == x[: n - m, 0]).all() and (rows.t == whole.t[: n - m]).all()
    last = STAGE.flush(state).rows.block()
    assert last.row == n - m and last.t.tolist() == whole.t[n - m :].tolist()
    assert np.isnan(last.y[:, 1]).all() and (last.y[:, 0] == x[n - m :, 0]).all()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.integers(1, 59), max_size=6, unique=True))
def test_partition_law(seed: int, cuts: list[int]) -> None:
    check_online(STAGE, block(seed), [sorted(cuts)])


def test_nothing_is_invented_near_gaps() -> None:
    """A filtered value exists exactly where its whole window is even, gapless and finite."""
    b = block(3, 400)
    rows = fold(STAGE, [b])[1].rows.block()
    m = STAGE.filter.delay
    even = np.abs(b.dt - 0.01) <= 0.005
    for i in range(len(rows.t)):
        window = slice(i - m, i + m + 1)
        inner = slice(i - m + 1, i + m + 1)
        whole = i >= m and even[inner].all() and not b.gap[inner].any()
        good = whole and np.isfinite(b.y[window, 1]).all()
        assert np.isfinite(rows.y[i, 1]) == good
        if good:
            expected = float(STAGE.filter.taps @ b.y[window, 1])
            assert abs(rows.y[i, 1] - expected) < 1e-10


def test_kernel_equals_its_plain_twin() -> None:
    b = block(5)
    compiled = fold(STAGE, [b])[1].rows
    plain_state = STAGE.init()
    lines = type(plain_state.ring)(
        b.t, b.dt, np.concatenate([b.u, b.y], axis=1), b.mark, b.task, b.gap
    )
    out = STAGE._lines(len(b.t))
    taps = np.append(STAGE.filter.taps, 1 / STAGE.filter.rate)
    columns = np.array(STAGE.columns, dtype=np.int64)
    left = slide.py_func(plain_state.ring, plain_state.counters, lines, out, columns, taps)
    assert left == len(compiled.t)
    values = np.concatenate([compiled.u, compiled.y], axis=1)
    assert out.v[:left].tobytes() == np.ascontiguousarray(values).tobytes()
    assert (out.mark[:left] == compiled.mark).all()


def test_smooth_misuse_and_short_streams() -> None:
    with pytest.raises(UsageError, match="columns below 3"):
        Smooth(STAGE.filter, (3,), 1, 2)
    state, out = fold(STAGE, [take(block(0), 0, 2)])
    assert out.rows is None and len(STAGE.flush(state).rows.t) == 2
    assert STAGE.flush(STAGE.init()).rows is None
