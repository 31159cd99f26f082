"""The signal-to-noise threshold: the simple detector.

The signal is the mean of the last ``window`` standardised residuals, the noise what that mean
scatters by on calm data. An alarm where their ratio exceeds ``threshold``. Simple to explain, quick
on jumps; it knows nothing of false alarms per month, so `evertwin.anomaly.Cusum` stands beside it.

>>> from evertwin.anomaly.calibration import Calm, calibrate
>>> rng = np.random.default_rng(0)
>>> calm = calibrate(Residuals.of(rng.normal(size=(2000, 1)), 1.0), Calm()).calibration
>>> r = rng.normal(size=(200, 1)); r[100:] += 3.0
>>> detector = SnrLimit(("x",), threshold=6.0, window=10)
>>> state, out = detector.step(detector.begin(calm), Residuals.of(r, 1.0))
>>> [event.row for event in out.records]
[106]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from evertwin.anomaly.calibration import Calibration, blank
from evertwin.anomaly.residuals import Alarms, Residuals
from evertwin.compiled.functions import njit
from evertwin.errors import UsageError
from evertwin.fold import Event, Out
from evertwin.types import Float64, Int64, Vector


class SnrState(NamedTuple):
    """The calibration and the last residuals.

    >>> SnrState._fields
    ('calibration', 'noise', 'ring', 'seen')
    """

    calibration: Calibration
    noise: Vector
    """Standard deviation of the mean over the window on calm data, (ny,)."""
    ring: Float64[np.ndarray, "ny window"]
    """Standardised residuals, the oldest overwritten."""
    seen: Int64[np.ndarray, "ny 2"]
    """Samples seen; is an alarm on (1)?"""


@njit(cache=True)
def watch(rows: Residuals, threshold: float, state: SnrState, out: Alarms, begins: Any) -> None:
    """Rows through the ring; the mean is summed anew at each row, so cuts cannot matter."""
    r, phase, known, ring, seen = rows.r, rows.phase, state.calibration, state.ring, state.seen
    window, alarm, statistic = ring.shape[1], out.alarm, out.statistic
    for i in range(r.shape[0]):
        for j in range(r.shape[1]):
            if r[i, j] != r[i, j]:
                continue
            z = (r[i, j] - known.mean[phase[i], j]) / known.scale[phase[i], j]
            ring[j, seen[j, 0] % window] = z
            seen[j, 0] += 1
            if seen[j, 0] < window:
                continue
            total = 0.0
            for m in range(window):
                total += ring[j, m]
            ratio = total / window / state.noise[j]
            statistic[i, j] = abs(ratio) / threshold
            if statistic[i, j] > 1.0:
                alarm[i, j] = 1 if ratio > 0 else -1
                begins[i, j] = seen[j, 1] == 0
            seen[j, 1] = 1 if statistic[i, j] > 1.0 else 0


@dataclass(frozen=True)
class SnrLimit:
    """The signal-to-noise detector. See the module.

    >>> SnrLimit(("x",)).threshold
    6.0
    """

    names: tuple[str, ...]
    threshold: float = 6.0
    """Ratio of signal to noise that is an alarm."""
    window: int = 20
    """Samples that the signal is averaged over."""
    phases: int = 1
    orders: int = 8
    """As in the calibration."""

    def __post_init__(self) -> None:
        if not (self.threshold > 0 and self.window >= 1):
            raise UsageError("snr: expected a threshold above 0 and a window of at least 1 sample")

    def init(self) -> SnrState:
        """Not calibrated: silent."""
        return self.begin(blank(self.phases, len(self.names), self.orders))

    def begin(self, calibration: Calibration) -> SnrState:
        """The state that starts from a calibration."""
        ny = len(self.names)
        seen = np.zeros((ny, 2), dtype=np.int64)
        noise = self.noise_of_means(calibration)
        return SnrState(calibration, noise, np.zeros((ny, self.window)), seen)

    def step(self, state: SnrState, block: Residuals) -> tuple[SnrState, Out]:
        """Rows of `Alarms` and an event where an alarm begins. Consumes ``state``."""
        shape = block.r.shape
        rows = Alarms(block.row, np.zeros(shape, dtype=np.int8), np.full(shape, np.nan))
        if not state.calibration.ready:
            return state, Out(rows)
        begins = np.zeros(shape, dtype=np.bool_)
        watch(block, self.threshold, state, rows, begins)
        found = np.argwhere(begins).tolist()
        return state, Out(rows, tuple(self._event(block, rows, i, j) for i, j in found))

    def noise_of_means(self, known: Calibration) -> np.ndarray:
        """Standard deviation of the mean of ``window`` samples of the autoregression, (ny,).

        The mean weights innovation ``m`` samples ago with the sum of the response it has left in
        the window.
        """
        noise = np.empty(len(self.names))
        for j, a in enumerate(known.ar):
            response = np.zeros(50 * self.window)
            response[0] = 1.0
            for m in range(1, len(response)):
                reach = min(m, len(a))
                response[m] = float(np.dot(a[:reach], response[m - reach : m][::-1]))
            sums = np.cumsum(response)
            weights = sums - np.concatenate([np.zeros(self.window), sums[: -self.window]])
            noise[j] = known.sigma[j] * float(np.sqrt(np.sum(weights**2))) / self.window
        return noise

    def _event(self, block: Residuals, rows: Alarms, i: int, j: int) -> Event:
        ratio = float(rows.statistic[i, j]) * self.threshold
        return Event(
            int(block.row[i]), int(block.t[i]), "suspected", self.names[j],
            f"signal to noise {ratio:.1f} over {self.window} samples, limit {self.threshold:g}",
            {"ratio": ratio, "threshold": self.threshold, "detector": "snr"},
        )  # fmt: skip
