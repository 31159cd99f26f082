"""Symmetric filters that a stream can hold: the phase stays as it is, rows leave a few later.

A low pass that runs forward and backward over a window has the impulse response of |H(f)|²: it is
symmetric and dies out. Cut where less than `TAIL` of it is left it is a symmetric FIR, so the
stream has the same filter as a whole recording, with its length as declared delay.

>>> low = Symmetric.butterworth(cutoff=5.0, rate=100.0)
>>> low.delay, round(float(low.half[0] + 2 * low.half[1:].sum()), 12)
(55, 1.0)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from evertwin.errors import UsageError
from evertwin.signals.fir_kernel import smooth
from evertwin.types import Outputs, Vector

TAIL = 1e-3
"""Share of the impulse response that may be cut off."""
LONGEST = 16_384
"""Rows of an impulse response."""


@dataclass(frozen=True)
class Symmetric:
    """Weights of a symmetric filter.

    >>> Symmetric(np.array([0.5, 0.25])).smooth(np.array([[0.0], [4.0], [0.0], [0.0]])).tolist()
    [[1.3333333333333333], [2.0], [1.0], [0.0]]
    """

    half: Vector
    """Weights from the middle outwards, (delay + 1,)."""

    @classmethod
    def butterworth(cls, cutoff: float, rate: float, order: int = 4) -> Symmetric:
        """A Butterworth low pass as it is forward and backward.

        Args:
            cutoff: where one pass has −3 dB [Hz].
            rate: rows per second [Hz].
            order: of one pass.

        Raises:
            UsageError: the cut-off is not below half the rate, or too low for a stream.
        """
        if not 0 < cutoff < rate / 2:
            raise UsageError(
                f"filter: expected a cut-off between 0 and half the rate of {rate:g} Hz, got "
                f"{cutoff:g} Hz"
            )
        sections = scipy.signal.butter(order, cutoff, fs=rate, output="sos")
        _, response = scipy.signal.sosfreqz(sections, worN=LONGEST, whole=True)
        impulse = np.fft.ifft(np.abs(response) ** 2).real[: LONGEST // 2]
        size = np.abs(impulse) * np.r_[1.0, np.full(len(impulse) - 1, 2.0)]
        left = size.sum() - np.cumsum(size)
        delay = int(np.argmax(left < TAIL * size.sum()))
        if delay > LONGEST // 4:
            raise UsageError(
                f"filter: a cut-off of {cutoff:g} Hz at {rate:g} rows per second needs {delay} "
                f"rows on either side: expected at most {LONGEST // 4}; lower [clock] rate"
            )
        return cls._of(impulse[: delay + 1])

    @classmethod
    def savgol(cls, window: int, degree: int) -> Symmetric:
        """A polynomial over a sliding window of ``window`` (odd) rows, at its middle.

        Raises:
            UsageError: the window is even, not longer than the degree, or too long for a stream.
        """
        if window % 2 == 0 or not degree < window <= LONGEST:
            raise UsageError(
                f"savgol: expected an odd window above the degree and below {LONGEST} rows, got "
                f"{window:.6g} and {degree}"
            )
        return cls._of(scipy.signal.savgol_coeffs(window, degree, use="dot")[window // 2 :])

    @classmethod
    def _of(cls, half: Vector) -> Symmetric:
        return cls(np.ascontiguousarray(half / (half[0] + 2.0 * half[1:].sum())))

    @property
    def delay(self) -> int:
        """Rows by which the output comes late in a stream."""
        return len(self.half) - 1

    def smooth(self, v: Outputs) -> Outputs:
        """Each column filtered over what is known of it; what is not known stays NaN.

        Where weights fall on rows that are not known, or beyond an end, the others are scaled up;
        with less than half of the weight known the result is NaN.
        """
        return np.asarray(smooth(np.ascontiguousarray(v, dtype=np.float64), self.half))


def slopes(window: int, rate: float, degree: int = 3) -> Outputs:
    """Weights of the derivative of a polynomial over ``window`` rows, at each row up to the middle.

    Row j of the result belongs to row j of the window; rows behind the middle mirror them with the
    sign turned. (window // 2 + 1, window).

    >>> (slopes(5, 1.0, 2)[2].round(3) + 0.0).tolist()
    [-0.2, -0.1, 0.0, 0.1, 0.2]
    """
    places = range(window // 2 + 1)
    rows = [
        scipy.signal.savgol_coeffs(window, degree, deriv=1, delta=1 / rate, pos=j, use="dot")
        for j in places
    ]
    return np.ascontiguousarray(rows)
