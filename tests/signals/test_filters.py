"""Filters against their definitions, and the streamed filter against the one over whole windows."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from evertwin.errors import DataError, UsageError
from evertwin.signals.filters import Butterworth, SavitzkyGolay, by_segment
from evertwin.signals.fir import Symmetric, slopes

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


def test_a_symmetric_filter_has_the_gain_of_both_directions() -> None:
    low = Symmetric.butterworth(5.0, 100.0)
    inner = slice(300, -300)
    for frequency in (1.0, 5.0, 20.0):
        wave = np.sin(2 * np.pi * frequency * np.arange(2000) / 100.0)[:, None]
        gain = np.ptp(low.smooth(wave)[inner]) / 2.0
        expected = 1.0 / (1.0 + (np.tan(np.pi * frequency / 100) / np.tan(np.pi * 0.05)) ** 8)
        assert gain == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("cutoff", [60.0, 1e-3])
def test_a_cut_off_that_a_stream_cannot_hold_is_refused(cutoff: float) -> None:
    with pytest.raises(UsageError, match="cut-off"):
        Symmetric.butterworth(cutoff, 100.0)


def test_an_even_window_is_refused() -> None:
    with pytest.raises(UsageError, match="odd window"):
        Symmetric.savgol(4, 2)
    assert Symmetric.savgol(5, 2).smooth(np.ones((9, 1)))[:, 0] == pytest.approx(np.ones(9))


def test_slopes_are_exact_on_their_polynomials() -> None:
    t = np.arange(7) * 0.1
    assert slopes(7, 10.0) @ (t**3 - t) == pytest.approx((3 * t**2 - 1)[:4])
