"""Filters for whole windows: zero-phase Butterworth, Savitzky-Golay smoothing and derivative.

Both leave the phase alone: the Butterworth because it runs forward and backward, which doubles its
order and makes −3 dB at the cut-off into −6; the Savitzky-Golay because its taps are symmetric. A
zero-phase filter looks ahead, so it belongs inside a window; in the stream
`evertwin.signals.smooth` does the same with a declared delay. The same filter goes over both sides
of a comparison.

>>> import numpy as np
>>> slow = np.sin(2 * np.pi * 1.0 * np.arange(0, 4, 0.01))[:, None]
>>> fast = 0.3 * np.sin(2 * np.pi * 30.0 * np.arange(0, 4, 0.01))[:, None]
>>> out = Butterworth(cutoff=5.0, rate=100.0)(slow + fast)
>>> bool(np.max(np.abs(out - slow)[50:-50]) < 0.01)
True
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from evertwin.errors import DataError, UsageError
from evertwin.types import Bools, Outputs, Vector

__all__ = ["Butterworth", "SavitzkyGolay", "by_segment"]


@dataclass(frozen=True)
class Butterworth:
    """A low pass of ``order``, run forward and backward over a window (n, k).

    >>> Butterworth(cutoff=5.0, rate=100.0).shortest
    16
    """

    cutoff: float
    """Where one pass has −3 dB [Hz]."""
    rate: float
    """Rows per second [Hz]; the rows must be evenly spaced."""
    order: int = 4

    def __post_init__(self) -> None:
        if not 0 < self.cutoff < self.rate / 2 or not 1 <= self.order <= 12:
            raise UsageError(
                f"butterworth: expected a cut-off between 0 and half the rate of {self.rate:g} Hz "
                f"and an order from 1 to 12, got {self.cutoff:g} Hz and {self.order}"
            )

    @cached_property
    def sections(self) -> Outputs:
        """Second-order sections."""
        return np.asarray(scipy.signal.butter(self.order, self.cutoff, fs=self.rate, output="sos"))

    @property
    def shortest(self) -> int:
        """Rows that a window needs at least: the filter's padding and one more."""
        return self._padding + 1

    @property
    def _padding(self) -> int:
        return 3 * (2 * ((self.order + 1) // 2) + 1)

    def __call__(self, v: Outputs) -> Outputs:
        """The filtered window.

        Raises:
            DataError: too short, or with NaN.
        """
        _check(v, self.shortest)
        return np.asarray(scipy.signal.sosfiltfilt(self.sections, v, axis=0, padlen=self._padding))


@dataclass(frozen=True)
class SavitzkyGolay:
    """A least-squares polynomial over a sliding window, evaluated at its middle.

    With x = a₀ + a₁τ + … fitted to the 2m + 1 rows around τ = 0, the output is a₀ (smoothing) or
    its derivative a₁ (``derivative=1``); both are fixed, symmetric or antisymmetric taps
    (Savitzky and Golay, Anal. Chem. 36, 1964).

    >>> import numpy as np
    >>> ramp = np.arange(0, 1, 0.01)[:, None] * 3.0
    >>> SavitzkyGolay(window=11, rate=100.0, derivative=1)(ramp)[:, 0].round(9).tolist()[0]
    3.0
    """

    window: int
    """Rows, odd."""
    rate: float
    """Rows per second [Hz]."""
    degree: int = 2
    derivative: int = 0

    def __post_init__(self) -> None:
        good = self.window % 2 == 1 and self.derivative <= self.degree < self.window
        if not good or self.rate <= 0 or self.derivative < 0:
            raise UsageError(
                f"savgol: expected an odd window above the degree and a derivative up to it, got "
                f"window {self.window}, degree {self.degree}, derivative {self.derivative}"
            )

    @property
    def delay(self) -> int:
        """Rows by which the output comes late in a stream."""
        return self.window // 2

    @cached_property
    def taps(self) -> Vector:
        """Weights of the rows of the window, oldest first, (window,)."""
        taps = scipy.signal.savgol_coeffs(
            self.window, self.degree, deriv=self.derivative, delta=1 / self.rate, use="dot"
        )
        return np.ascontiguousarray(taps, dtype=np.float64)

    @property
    def shortest(self) -> int:
        """Rows that a window needs at least."""
        return self.window

    def __call__(self, v: Outputs) -> Outputs:
        """The filtered window; its ends are the polynomial of the first and last rows.

        Raises:
            DataError: too short, or with NaN.
        """
        _check(v, self.window)
        return np.asarray(
            scipy.signal.savgol_filter(
                v, self.window, self.degree, self.derivative, delta=1 / self.rate, axis=0
            )
        )


def _check(v: Outputs, shortest: int) -> None:
    if len(v) < shortest:
        raise DataError(f"filter: expected at least {shortest} rows, got {len(v)}")
    if not np.isfinite(v).all():
        row = int(np.flatnonzero(~np.isfinite(v).all(axis=1))[0])
        raise DataError(f"filter: row {row} is not finite: filter between gaps, see by_segment")


def by_segment(
    function: Callable[[Outputs], Outputs], v: Outputs, gap: Bools, shortest: int
) -> Outputs:
    """``function`` over each stretch without a gap or an absent row; NaN where it is too short.

    Args:
        function: (n, k) → (n, k).
        v: values, (n, k).
        gap: True where a stretch begins, (n,).
        shortest: rows that ``function`` needs.

    >>> import numpy as np
    >>> v = np.array([[1.0], [np.nan], [3.0], [4.0]])
    >>> by_segment(lambda x: x * 10, v, np.zeros(4, bool), 2)[:, 0].tolist()
    [nan, nan, 30.0, 40.0]
    """
    good = np.isfinite(v).all(axis=1)
    begins = good & (gap | ~np.concatenate([[False], good[:-1]]))
    label = np.where(good, np.cumsum(begins), 0)
    out = np.full(v.shape, np.nan)
    for number in range(1, int(begins.sum()) + 1):
        rows = np.flatnonzero(label == number)
        if len(rows) >= shortest:
            out[rows] = function(v[rows])
    return out
