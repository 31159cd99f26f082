"""The calibrated CUSUM: a lasting shift of the residual, found within a set number of false alarms.

A stage of the stream. Until it is calibrated it collects calm rows and tries after 1, 2, 4, …
times the least number of samples; while that fails the state says "not calibrated yet", as an
event with its reason. It may also start from a calibration made elsewhere (`Cusum.begin`).
One event tells the begin of each excursion; an excursion ends after ``quiet`` samples without
alarm.

>>> rng = np.random.default_rng(0)
>>> detector = Cusum(("speed",), Calm())
>>> r = rng.normal(size=(3000, 1))
>>> r[2500:] += 4.0
>>> state, out = detector.step(detector.init(), Residuals.of(r, interval=3.0))
>>> [(event.kind, event.row) for event in out.records]
[('suspected', 2503)]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from evertwin.anomaly.calibration import Calibration, Calm, blank, calibrate, whitened
from evertwin.anomaly.residuals import Alarms, Residuals
from evertwin.compiled.functions import njit
from evertwin.compiled.memory import copied
from evertwin.errors import UsageError
from evertwin.fold import Event, Out
from evertwin.types import Float64, Int64, Vector


class CusumState(NamedTuple):
    """The calibration, the running sums, and the calm rows collected so far.

    >>> CusumState._fields[0]
    'calibration'
    """

    calibration: Calibration
    past: Float64[np.ndarray, "ny orders"]
    """Last standardised residuals, latest first."""
    sums: Float64[np.ndarray, "ny 2"]
    """Up and down."""
    seen: Int64[np.ndarray, "ny 3"]
    """Samples in ``past``; samples since the last alarm in the phase that it came in (−1: no
    excursion); that phase."""
    calm: Residuals
    """Rows collected for calibrating, up to a fixed capacity."""
    collected: int
    height: Float64[np.ndarray, "ny 2"]
    """Up and down of the newest excursion, as the sums were without an alarm."""
    peak: Vector
    """Largest of them, (ny,)."""


@njit(cache=True)
def watch(
    part: Residuals, rule: tuple[float, float, int], state: CusumState, out: Alarms, begins: Any
) -> int:
    """How many excursions start, marked in ``begins``. Rows through whitening and CUSUM.

    Args:
        rule: what is taken off each sum, the largest innovation, samples that end an excursion.
    """
    (k, clip, quiet), known, started = rule, state.calibration, 0
    r, phase, alarm, statistic = part.r, part.phase, out.alarm, out.statistic
    past, sums, seen, height, peak = state.past, state.sums, state.seen, state.height, state.peak
    for i in range(r.shape[0]):
        for j in range(r.shape[1]):
            x = r[i, j]
            statistic[i, j] = max(sums[j, 0], sums[j, 1]) / known.limit[j]
            if x != x:
                continue
            z = (x - known.mean[phase[i], j]) / known.scale[phase[i], j]
            e = whitened(known, past, j, z)
            if seen[j, 1] >= 0 and phase[i] == seen[j, 2]:  # others say nothing of it
                seen[j, 1] = -1 if seen[j, 1] >= quiet else seen[j, 1] + 1
            if seen[j, 0] < known.ar.shape[1]:
                seen[j, 0] += 1
                continue
            e = min(max(e / known.sigma[j], -clip), clip)
            sums[j, 0] = max(0.0, sums[j, 0] + e - k)
            sums[j, 1] = max(0.0, sums[j, 1] - e - k)
            statistic[i, j] = max(sums[j, 0], sums[j, 1]) / known.limit[j]
            if seen[j, 1] >= 0:
                height[j, 0] = max(0.0, height[j, 0] + e - k)
                height[j, 1] = max(0.0, height[j, 1] - e - k)
                peak[j] = max(peak[j], height[j, 0], height[j, 1])
            if statistic[i, j] > 1.0:
                alarm[i, j] = 1 if sums[j, 0] > sums[j, 1] else -1
                if seen[j, 1] < 0:
                    begins[i, j] = True
                    copied(height[j], sums[j])
                    peak[j] = max(sums[j, 0], sums[j, 1])
                    started += 1
                sums[j, :] = 0.0
                seen[j, 1], seen[j, 2] = 0, phase[i]
    return started


@dataclass(frozen=True)
class Cusum:
    """The detector of lasting shifts. See the module.

    >>> Cusum(("force",)).init().calibration.ready
    False
    """

    names: tuple[str, ...]
    """Names of the outputs, for events."""
    calm: Calm = Calm()
    phases: int = 1
    capacity: int = 1 << 14
    """Most rows kept for calibrating; when they do not suffice the older half is dropped."""
    quiet: int = 100
    """Samples without alarm that end an excursion, of all phases."""

    def __post_init__(self) -> None:
        if self.capacity < 2 * self.calm.least:
            raise UsageError(
                f"cusum: expected a capacity of at least twice {self.calm.least} samples, got "
                f"{self.capacity}"
            )

    def init(self) -> CusumState:
        """Not calibrated yet, nothing collected."""
        ny = len(self.names)
        empty, seen = np.zeros(self.capacity, dtype=np.int64), np.array([0, -1, 0], dtype=np.int64)
        return CusumState(
            blank(self.phases, ny, self.calm.orders), np.zeros((ny, self.calm.orders)),
            np.zeros((ny, 2)), np.tile(seen, (ny, 1)),
            Residuals(empty, empty.copy(), np.zeros((self.capacity, ny)), empty.copy()), 0,
            np.zeros((ny, 2)), np.zeros(ny),
        )  # fmt: skip

    def begin(self, calibration: Calibration) -> CusumState:
        """The state that starts from a calibration on other data."""
        return self.init()._replace(calibration=calibration)

    def collect(self, state: CusumState, block: Residuals) -> CusumState:
        """Takes calm rows without an attempt to calibrate; the oldest make room. Consumes
        ``state``."""
        have, n = state.collected, len(block.row)
        if n > self.capacity:
            block, n = block.take(n - self.capacity, n), self.capacity
        drop = max(0, have + n - self.capacity)
        for kept, new in zip(state.calm, block, strict=True):
            if drop:
                kept[: have - drop] = kept[drop:have].copy()
            kept[have - drop : have - drop + n] = new
        return state._replace(collected=have - drop + n)

    def settle(self, state: CusumState) -> tuple[CusumState, str]:
        """Calibrates on what was collected; if that does not suffice, the reason."""
        found, reason = calibrate(state.calm.take(0, state.collected), self.calm, self.phases)
        return (state, reason) if reason else (self.begin(found), "")

    def on(self, state: CusumState) -> tuple[str, ...]:
        """Names of the outputs that are in an excursion now."""
        return tuple(name for name, seen in zip(self.names, state.seen[:, 1]) if seen >= 0)

    def restart(self, state: CusumState) -> CusumState:
        """The same calibration, sums and memory cleared: after the model has changed."""
        return self.begin(state.calibration)

    def step(self, state: CusumState, block: Residuals) -> tuple[CusumState, Out]:
        """Rows of `Alarms`, and an event per excursion. Consumes ``state``."""
        n = len(block.row)
        shape = block.r.shape
        rows = Alarms(block.row, np.zeros(shape, dtype=np.int8), np.empty(shape))
        rows.statistic.fill(np.nan)
        records: list[Event] = []
        at = 0
        while at < n:
            if state.calibration.ready:
                state = self._watch(state, block, rows, at, records)
                break
            state, at = self._collect(state, block, at, records)
        return state, Out(rows, tuple(records))

    def _watch(
        self, state: CusumState, block: Residuals, rows: Alarms, at: int, records: list[Event]
    ) -> CusumState:
        part = block.take(at, len(block.row)) if at else block
        begins, out = np.zeros(part.r.shape, dtype=np.bool_), Alarms(*(one[at:] for one in rows))
        rule = 0.5 * self.calm.shift, self.calm.clip, self.quiet // self.phases
        started, limit = watch(part, rule, state, out, begins), state.calibration.limit
        for i, j in np.argwhere(begins).tolist() if started else ():
            word = "above" if rows.alarm[at + i, j] > 0 else "below"
            records.append(
                Event(
                    int(part.row[i]), int(part.t[i]), "suspected", self.names[j],
                    f"the residual stays {word} what is calm: "
                    f"CUSUM {rows.statistic[at + i, j]:.2f} times its limit",
                    {"statistic": float(rows.statistic[at + i, j]), "limit": float(limit[j]),
                     "residual": float(part.r[i, j]), "phase": int(part.phase[i])},
                )
            )  # fmt: skip
        return state

    def _collect(
        self, state: CusumState, block: Residuals, at: int, records: list[Event]
    ) -> tuple[CusumState, int]:
        """Takes rows up to the next attempt; there it calibrates."""
        have = state.collected
        goal = self.calm.least
        while goal <= have:
            goal *= 2
        goal = min(goal, self.capacity)
        stop = min(at + goal - have, len(block.row))
        state = self.collect(state, block.take(at, stop))
        have = state.collected
        if have < goal:
            return state, stop
        found, reason = calibrate(state.calm.take(0, have), self.calm, self.phases)
        if not reason:
            return self.begin(found), stop
        for j, name in enumerate(self.names):
            reason = reason.replace(f"output {j}:", f"{name}:")
        last = block.take(stop - 1, stop)
        records.append(
            Event(int(last.row[0]), int(last.t[0]), "not_calibrated", "", reason, {"rows": have})
        )
        if have == self.capacity:
            half = have // 2
            for kept in state.calm:
                kept[:half] = kept[half:have].copy()
            have = half
        return state._replace(collected=have), stop
