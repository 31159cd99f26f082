"""Symmetric filters against their definitions."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from evertwin.errors import UsageError
from evertwin.signals.fir import Symmetric, slopes


@pytest.mark.parametrize("order", [1, 2, 4, 5])
def test_butterworth_gain_and_phase(order: int) -> None:
    low_pass = Symmetric.butterworth(cutoff=5.0, rate=100.0, order=order)
    for frequency in (1.0, 5.0, 12.0):
        x = np.sin(2 * np.pi * frequency * np.arange(2000) / 100)[:, None]
        y = low_pass.smooth(x)
        # Analogue prototype, warped by the bilinear transform, passed twice.
        warped = np.tan(np.pi * frequency / 100) / np.tan(np.pi * 5 / 100)
        gain = 1 / (1 + warped ** (2 * order))
        np.testing.assert_allclose(y[500:1500], gain * x[500:1500], atol=3e-3)


def test_butterworth_is_scipys_forward_and_backward() -> None:
    x = np.random.default_rng(0).normal(size=(600, 3))
    b, a = scipy.signal.butter(4, 5.0, fs=100.0)
    reference = scipy.signal.filtfilt(b, a, x, axis=0)
    found = Symmetric.butterworth(5.0, 100.0).smooth(x)
    np.testing.assert_allclose(found[150:450], reference[150:450], atol=2e-3)


@pytest.mark.parametrize("rows", [700, 1500])
def test_whole_windows_are_summed_by_the_weights(rows: int) -> None:
    x, low = np.random.default_rng(rows).normal(size=rows), Symmetric.butterworth(5.0, 250.0)
    found = low.smooth(x[:, None])[low.delay : -low.delay, 0]
    weights = np.concatenate([low.half[:0:-1], low.half])
    np.testing.assert_allclose(found, np.convolve(x, weights, "valid"), rtol=0, atol=1e-12)


@pytest.mark.parametrize("cutoff", [0.0, 50.0, 60.0, 1e-3, -1.0])
def test_a_cut_off_that_a_stream_cannot_hold_is_refused(cutoff: float) -> None:
    with pytest.raises(UsageError, match="cut-off"):
        Symmetric.butterworth(cutoff, 100.0)


def test_an_even_window_is_refused() -> None:
    for window, degree in ((10, 2), (5, 5)):
        with pytest.raises(UsageError, match="odd window"):
            Symmetric.savgol(window, degree)
    assert Symmetric.savgol(5, 2).smooth(np.ones((9, 1)))[:, 0] == pytest.approx(np.ones(9))


def test_slopes_are_exact_on_their_polynomials() -> None:
    t = np.arange(7) * 0.1
    assert slopes(7, 10.0) @ (t**3 - t) == pytest.approx((3 * t**2 - 1)[:4])
