"""How late one signal is after another: transport lag, and the offset of two clocks, with figures.

Two signals that show the same motion, b(t) = g·a(t − τ) + noise, are compared by their rates of
change, so that offsets and slow drifts do not count. The normalised cross-correlation has its peak
near τ; a parabola through its top gives a start between samples, and Gauss-Newton on (g, τ) with a
cubic spline of a ends at the least-squares value. Its variance is the sandwich
(JᵀJ)⁻¹·M·(JᵀJ)⁻¹, with M from the autocovariance of J·residual (Newey and West, 1987), because the
residuals of smoothed rates are not white. A motion without change gives no lag, and says so.

>>> import numpy as np
>>> t = np.arange(0, 20, 0.02)
>>> a = np.sin(t) + np.sin(2.7 * t)
>>> b = np.sin(t - 0.13) + np.sin(2.7 * (t - 0.13))
>>> ns = np.rint(t * 1e9).astype(np.int64)
>>> round(lag(ns, a, ns, b, longest=0.5).seconds, 3)
0.13
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
import scipy

from evertwin.errors import DataError
from evertwin.signals.resample import linear, uniform
from evertwin.types import Float64, Int64, Stamps, Vector

First: TypeAlias = Float64[np.ndarray, " n"]
Second: TypeAlias = Float64[np.ndarray, " m"]
Others: TypeAlias = Int64[np.ndarray, " m"]

_MOST = 1 << 18
"""Grid points of the longest comparison."""
_LARGEST = 1e60
"""Rates of change above it, squared twice in a fit, would leave the range of numbers."""
_WINDOWS = (7, 21, 63)
"""Rows of the Savitzky-Golay windows that the rates are taken with; the surest lag counts."""


@dataclass(frozen=True)
class Lag:
    """A lag with its uncertainty.

    >>> Lag(0.5, 0.25, 0.98, 1.0, "identified", "").interval95
    (0.010000000000000009, 0.99)
    """

    seconds: float
    """How much later the second signal is [s]; NaN where none was found."""
    sigma: float
    """Standard error [s]; infinite where none was found."""
    correlation: float
    """Of the two rates at the lag."""
    gain: float
    """Second signal per first."""
    verdict: str
    """identified, weak or not."""
    reason: str

    @property
    def interval95(self) -> tuple[float, float]:
        """95 % interval [s]."""
        reach = 1.96 * self.sigma
        return (self.seconds - reach, self.seconds + reach)


class _Pair(NamedTuple):
    a: Vector
    b: Vector
    period: float


def lag(ta: Stamps, a: First, tb: Others, b: Second, longest: float) -> Lag:
    """The lag of ``b`` after ``a``.

    Args:
        ta: stamps of the first signal [ns], increasing, (n,).
        a: first signal, such as a command; NaN where absent.
        tb: stamps of the second signal [ns], increasing, (m,).
        b: second signal, such as what was measured.
        longest: lags from −longest to +longest are looked at [s].

    Raises:
        DataError: the two hardly overlap.
    """
    levels = _levels(ta, a, tb, b)
    reach, rows = int(np.ceil(longest / levels.period)), len(levels.a)
    if rows < 4 * reach + 10:
        raise DataError(
            f"lag: expected more than {(4 * reach + 10) * levels.period:.3g} s that both signals "
            f"cover, got {rows * levels.period:.3g} s: look at shorter lags"
        )
    found = [_by_rates(levels, window, reach) for window in _WINDOWS if 100 * window < rows]
    found = found or [_by_rates(levels, _WINDOWS[0], reach)]
    rank = {"identified": 0, "weak": 1, "not": 2}
    return min(found, key=lambda one: (rank[one.verdict], one.sigma))


def _by_rates(levels: _Pair, window: int, reach: int) -> Lag:
    """The lag from rates of change taken over ``window`` rows."""
    rates = _rates(levels, window)
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.std(rates.a), np.std(rates.b)
    if not np.max(size) < _LARGEST:
        return _none("one of the signals grows beyond all bounds: look at the model's prediction")
    if not np.min(size) > 1e-12:
        return _none("one of the signals does not change: move the machine")
    score = _correlation(rates, reach)
    best = int(np.argmax(np.abs(score)))
    if best in (0, 2 * reach):
        return _none(
            f"the best match lies at the end of ±{reach * rates.period:.3g} s: look further"
        )
    top = np.abs(score[best - 1 : best + 2])
    bend = top[0] - 2 * top[1] + top[2]
    shift = 0.5 * (top[0] - top[2]) / bend if bend < 0 else 0.0
    return _refined(rates, (best - reach + shift) * rates.period, score, window)


def _none(reason: str) -> Lag:
    return Lag(float("nan"), float("inf"), 0.0, float("nan"), "not", reason)


def _levels(ta: Stamps, a: First, tb: Others, b: Second) -> _Pair:
    """Both signals on one grid; NaN where a signal is absent."""
    if len(ta) < 3 or len(tb) < 3:
        raise DataError("lag: expected at least 3 samples of each signal")
    start, stop = max(int(ta[0]), int(tb[0])), min(int(ta[-1]), int(tb[-1]))
    period = int(min(np.median(np.diff(ta)), np.median(np.diff(tb))))
    period = max(period, (stop - start) // _MOST, 1)
    if stop - start < 20 * period:
        raise DataError("lag: the two signals overlap by less than 20 samples: check their clocks")
    grid = uniform(start, stop, period)
    out = [
        linear(t, v[:, None], grid, int(5 * np.median(np.diff(t))))[:, 0]
        for t, v in ((ta, a), (tb, b))
    ]
    return _Pair(out[0], out[1], period * 1e-9)


def _rates(levels: _Pair, window: int) -> _Pair:
    """Rates of change; zero, which matches nothing, near what is absent."""
    out = []
    for level in levels[:2]:
        absent = ~np.isfinite(level)
        known = np.where(absent, 0.0, level)
        rate = scipy.signal.savgol_filter(known, window, 2, deriv=1, delta=levels.period)
        near = scipy.signal.fftconvolve(absent.astype(float), np.ones(window), mode="same") > 0.5
        rate = np.where(near, 0.0, rate)
        out.append(rate - np.where(near, 0.0, rate[~near].mean() if (~near).any() else 0.0))
    return _Pair(out[0], out[1], levels.period)


def _correlation(rates: _Pair, reach: int) -> Vector:
    """Normalised cross-correlation for lags −reach … reach, (2·reach + 1,)."""
    n = len(rates.a)
    full = scipy.signal.correlate(rates.b, rates.a, mode="full", method="fft")
    middle = full[n - 1 - reach : n + reach]
    return np.asarray(middle / np.sqrt(np.sum(rates.a**2) * np.sum(rates.b**2)))


def _refined(rates: _Pair, tau: float, score: Vector, window: int) -> Lag:
    time = np.arange(len(rates.a)) * rates.period
    spline = scipy.interpolate.CubicSpline(time, rates.a)
    slope = spline.derivative()
    inside = slice(len(score) // 2 + 2, len(rates.a) - len(score) // 2 - 2)
    at, b = time[inside], rates.b[inside]
    start = tau
    for _ in range(8):
        model, bend = spline(at - tau), slope(at - tau)
        gain = float(model @ b / (model @ model))
        step, *_ = np.linalg.lstsq(
            np.column_stack([model, -gain * bend]), b - gain * model, rcond=None
        )
        tau += float(np.clip(step[1], -rates.period, rates.period))
        if abs(step[1]) < 1e-6 * rates.period:
            break
    if abs(tau - start) > 2 * rates.period:
        tau = start
    model = spline(at - tau)
    gain = float(model @ b / (model @ model))
    residual = b - gain * model
    jacobian = np.column_stack([model, -gain * slope(at - tau)])
    if not np.linalg.cond(jacobian.T @ jacobian) < 1 / np.finfo(float).eps:
        return _none("the two signals hardly change while both are there")
    sigma = float(np.sqrt(_sandwich(jacobian, residual, window)[1, 1]))
    fit = 1 - float(residual @ residual) / float(b @ b)
    correlation = float(np.sqrt(max(fit, 0.0)))
    verdict, reason = _verdict(correlation, sigma, score, rates.period)
    return Lag(float(tau), sigma, correlation, gain, verdict, reason)


def _sandwich(jacobian: np.ndarray, residual: Vector, window: int) -> np.ndarray:
    """Covariance of the estimate under correlated residuals, (2, 2)."""
    bread = np.linalg.inv(jacobian.T @ jacobian)
    scores = jacobian * residual[:, None]
    lags = min(len(residual) // 4, 4 * window + int(len(residual) ** (1 / 3)))
    meat = scores.T @ scores
    for k in range(1, lags + 1):
        cross = scores[k:].T @ scores[:-k]
        meat += (1 - k / (lags + 1)) * (cross + cross.T)
    return np.asarray(bread @ meat @ bread)


def _verdict(correlation: float, sigma: float, score: Vector, period: float) -> tuple[str, str]:
    height = np.abs(score)
    best = int(np.argmax(height))
    peaks = scipy.signal.find_peaks(height)[0]
    others = height[peaks[np.abs(peaks - best) > 2]]
    if len(others) and others.max() > 0.97 * height[best]:
        return "weak", "another lag fits as well: the motion repeats itself"
    if correlation < 0.3:
        return "weak", f"the rates agree little (correlation {correlation:.2f})"
    if sigma > 5 * period:
        return "weak", f"uncertain by {sigma:.3g} s: more or faster motion is needed"
    return "identified", f"correlation {correlation:.3f} over the record"


@dataclass(frozen=True)
class Offset:
    """Offset and drift between two clocks that saw the same motion.

    >>> Offset(0.5, 0.001, 1e-5, 1e-6, 0, ()).drift
    1e-05
    """

    seconds: float
    """Clock of the second signal minus clock of the first, at ``middle`` [s]."""
    sigma: float
    drift: float
    """Growth of the offset, seconds per second."""
    drift_sigma: float
    """Infinite where fewer than three pieces gave a lag."""
    middle: int
    """Stamp the offset is stated at [ns]."""
    pieces: tuple[Lag, ...]
    """The lag of each piece."""


def clock_offset(
    ta: Stamps, a: First, tb: Others, b: Second, longest: float, pieces: int = 5
) -> Offset:
    """Offset and drift of the second clock, from the lags of consecutive pieces.

    Both signals must show the same quantity without a lag of their own: an offset and a transport
    lag cannot be told apart.

    Args:
        ta: stamps of the first signal [ns], (n,).
        a: first signal.
        tb: stamps of the second [ns], (m,).
        b: second signal.
        longest: largest offset that is looked for [s].
        pieces: how many pieces the common time is cut into.

    Raises:
        DataError: no piece gives a lag.
    """
    start, stop = max(int(ta[0]), int(tb[0])), min(int(ta[-1]), int(tb[-1]))
    edges = np.linspace(start, stop, pieces + 1).astype(np.int64)
    lags, middles = [], []
    for low, high in itertools.pairwise(edges):
        i, j = np.searchsorted(ta, [low, high]), np.searchsorted(tb, [low, high])
        found = lag(ta[slice(*i)], a[slice(*i)], tb[slice(*j)], b[slice(*j)], longest)
        if found.verdict != "not":
            lags.append(found)
            middles.append((int(low) + int(high)) // 2)
    if not lags:
        raise DataError("clock offset: no piece shows enough motion to compare the clocks by")
    middle = int(np.mean(np.array(middles) - middles[0])) + middles[0]
    return _line_through(lags, np.array([(m - middle) * 1e-9 for m in middles]), middle)


def _line_through(lags: list[Lag], x: Vector, middle: int) -> Offset:
    """Weighted least squares of lag over time; its scatter widens the errors where it is larger."""
    y = np.array([one.seconds for one in lags])
    w = 1 / np.maximum([one.sigma for one in lags], 1e-9) ** 2
    columns = np.ones((len(x), 1)) if len(x) < 3 else np.column_stack([np.ones(len(x)), x])
    covariance = np.linalg.inv(columns.T @ (w[:, None] * columns))
    value = covariance @ (columns.T @ (w * y))
    spread = float(np.sum(w * (y - columns @ value) ** 2)) / max(len(x) - columns.shape[1], 1)
    covariance = covariance * max(spread, 1.0)
    drift, error = (0.0, float("inf")) if len(x) < 3 else (value[1], np.sqrt(covariance[1, 1]))
    sigma = float(np.sqrt(covariance[0, 0]))
    return Offset(float(value[0]), sigma, float(drift), float(error), middle, tuple(lags))
