"""Drift: is the model about to leave the range it is valid in?

Two ADWIN windows per output, on the innovation (has its mean moved?) and on its size (has its
spread changed?), fed with predictions over one horizon, which the twin's own updates cannot hide.
The residual is standardised and whitened by a calibration, so that one ``delta`` serves all
outputs: ADWIN's bound is for independent samples. Innovations enter by means of ``batch``
consecutive ones, which saves time and finds slow changes as well.

>>> from evertwin.anomaly.calibration import Calm, calibrate, whitened
>>> rng = np.random.default_rng(0)
>>> calm = calibrate(Residuals.of(rng.normal(size=(2000, 1)), 1.0), Calm()).calibration
>>> r = rng.normal(size=(4000, 1)); r[2000:] *= 2.0
>>> detector = Drift(("x",))
>>> state, out = detector.step(detector.begin(calm), Residuals.of(r, 1.0))
>>> [(event.kind, event.evidence["of"]) for event in out.records][:1]
[('drift', 'spread')]
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from evertwin.anomaly.adwin import CLOCK, LEVELS, TOTAL, WIDTH, add, new
from evertwin.anomaly.calibration import Calibration, blank, whitened
from evertwin.anomaly.residuals import Residuals
from evertwin.compiled.functions import njit
from evertwin.fold import Event, Out
from evertwin.types import Float64, Int64

KINDS = ("mean", "spread")
USUAL = float(np.sqrt(2.0 / np.pi))
"""Mean size of a normal innovation."""


class DriftState(NamedTuple):
    """The calibration, the past for whitening, and the windows.

    >>> DriftState._fields
    ('calibration', 'past', 'seen', 'sums', 'windows')
    """

    calibration: Calibration
    past: Float64[np.ndarray, "ny orders"]
    seen: Int64[np.ndarray, " ny"]
    sums: Float64[np.ndarray, "ny 2"]
    """Sum and sum of sizes of the batch so far."""
    windows: Float64[np.ndarray, "windows levels columns"]
    """Mean and spread of each output in turn."""


@njit(cache=True)
def watch(rows: Residuals, rule: tuple[float, float, int], state: DriftState, level: Any) -> int:
    """How many changes. Rows through whitening and both windows; ``level`` gets the new means.

    Args:
        rule: the largest innovation, chance of a false cut, innovations of a batch.
    """
    (clip, delta, batch), known, orders = rule, state.calibration, state.past.shape[1]
    r, phase, seen, sums, windows = rows.r, rows.phase, state.seen, state.sums, state.windows
    clock, grow, changes = max(1, CLOCK // batch), math.sqrt(batch), 0
    for i in range(r.shape[0]):
        for j in range(r.shape[1]):
            if r[i, j] != r[i, j]:
                continue
            z = (r[i, j] - known.mean[phase[i], j]) / known.scale[phase[i], j]
            e = whitened(known, state.past, j, z)
            seen[j] += 1
            if seen[j] <= orders:
                continue
            e = min(max(e / known.sigma[j], -clip), clip)
            sums[j, 0] += e
            sums[j, 1] += abs(e)
            if (seen[j] - orders) % batch != 0:
                continue
            for m in range(2):
                window = windows[2 * j + m]
                if add(window, sums[j, m] / batch * grow, delta, clock):
                    level[i, 2 * j + m] = window[LEVELS, TOTAL] / window[LEVELS, WIDTH] / grow
                    changes += 1
                sums[j, m] = 0.0
    return changes


@dataclass(frozen=True)
class Drift:
    """The drift detector. See the module.

    >>> Drift(("a", "b")).init().windows.shape[0]
    4
    """

    names: tuple[str, ...]
    delta: float = 1e-4
    """Chance of a false cut, per test of one window."""
    clip: float = 8.0
    batch: int = 8
    """Innovations that are averaged before they enter a window."""
    phases: int = 1
    orders: int = 8
    """As in the calibration."""

    def init(self) -> DriftState:
        """Not calibrated: silent."""
        return self.begin(blank(self.phases, len(self.names), self.orders))

    def begin(self, calibration: Calibration) -> DriftState:
        """The state that starts from a calibration."""
        ny = len(self.names)
        return DriftState(
            calibration, np.zeros((ny, self.orders)), np.zeros(ny, dtype=np.int64),
            np.zeros((ny, 2)), new(2 * ny),
        )  # fmt: skip

    def step(self, state: DriftState, block: Residuals) -> tuple[DriftState, Out]:
        """Events ``drift`` with what has changed and to which value. Consumes ``state``."""
        if not state.calibration.ready:
            return state, Out()
        level = np.empty((len(block.row), 2 * len(self.names)))
        level.fill(np.nan)
        changes = watch(block, (self.clip, self.delta, self.batch), state, level)
        if changes == 0:
            return state, Out()
        # a spread that falls is no trouble: the model is as near as before, or nearer
        level[:, 1::2][level[:, 1::2] < USUAL] = np.nan
        places = np.argwhere(np.isfinite(level))
        return state, Out(records=tuple(self._event(block, level, *place) for place in places))

    def _event(self, block: Residuals, level: np.ndarray, row: int, column: int) -> Event:
        kind, value = KINDS[column % 2], float(level[row, column])
        usual = 0.0 if kind == "mean" else USUAL
        return Event(
            int(block.row[row]), int(block.t[row]), "drift", self.names[column // 2],
            f"the {kind} of the residual has moved to {value:.2f} standard deviations, calm is "
            f"{usual:.2f}",
            {"of": kind, "value": value, "usual": usual, "delta": self.delta},
        )  # fmt: skip
