"""The detectors of a twin over released rows: CUSUM, drift, signal to noise, on one calibration.

They begin silent. The CUSUM collects calm rows and calibrates itself; the others start from its
calibration at the next beat, so that where rows are cut cannot matter. A new champion has other
residuals: everything begins anew with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evertwin.anomaly import (
    Calm,
    Cusum,
    CusumState,
    Drift,
    DriftState,
    Residuals,
    SnrLimit,
    SnrState,
)
from evertwin.config.spec import AnomalySpec
from evertwin.fold import Event, Record
from evertwin.loop.released import Released

QUIET = 1000
"""Rows without a further drift of an output that end an excursion."""


class Alarm(NamedTuple):
    """What a detector found, and nothing was decided about yet.

    >>> Alarm().kind
    ''
    """

    kind: str = ""
    """Kind of its event; empty: there is none."""
    signal: str = ""
    reason: str = ""
    row: int = 0
    """At which it was found."""


class DetectState(NamedTuple):
    """States of the detectors, and what was not yet acted on.

    >>> DetectState._fields
    ('cusum', 'drift', 'snr', 'told', 'pending', 'tried')
    """

    cusum: CusumState
    drift: DriftState
    snr: SnrState
    told: np.ndarray
    """Row of each output's newest drift, int64: one event tells of an excursion."""
    pending: Alarm
    """The oldest alarm that was not yet acted on."""
    tried: int = 0
    """Calm rows at the last attempt to calibrate on a span that the twin file sets."""


@dataclass(frozen=True)
class Detect:
    """The detectors together. Built by `Detect.of`.

    >>> Detect.of(AnomalySpec(), ("x",), np.array([True]), 1).columns
    (0,)
    """

    cusum: Cusum
    drift: Drift
    snr: SnrLimit
    columns: tuple[int, ...]
    """Outputs that are watched."""
    use_snr: bool
    calibration: float = 0.0
    """Span of calm data that calibrates [s]; 0: as soon as it suffices; inf: the first task."""

    @classmethod
    def of(
        cls, spec: AnomalySpec, names: tuple[str, ...], watched: np.ndarray, phases: int
    ) -> Detect:
        """As the twin file says."""
        columns = tuple(int(k) for k in np.flatnonzero(watched))
        chosen = tuple(names[k] for k in columns)
        calm = Calm(false_alarms_per_month=spec.false_alarms_per_month)
        limit = SnrLimit(chosen, spec.snr or 6.0, phases=phases, orders=calm.orders)
        return cls(
            Cusum(chosen, calm, phases), Drift(chosen, phases=phases, orders=calm.orders), limit,
            columns, spec.snr > 0, spec.calibration,
        )  # fmt: skip

    def init(self) -> DetectState:
        """Nothing calibrated."""
        told = np.full(len(self.columns), -QUIET, dtype=np.int64)
        return DetectState(self.cusum.init(), self.drift.init(), self.snr.init(), told, Alarm())

    def step(self, state: DetectState, rows: Released) -> tuple[DetectState, tuple[Event, ...]]:
        """More rows; consumes ``state``."""
        every = len(self.columns) == rows.live.shape[1]
        live = rows.live if every else rows.live.take(self.columns, axis=1)
        seen, unknown = Residuals(rows.row, rows.t, live, rows.phase), np.isnan(live)
        if unknown.any():
            known = ~unknown.all(axis=1)
            if not known.any():
                return state, ()
            if not known.all():
                seen = Residuals(*(column[known] for column in seen))
        if self.calibration > 0 and not state.cusum.calibration.ready:
            return state._replace(cusum=self.cusum.collect(state.cusum, seen)), ()
        cusum, a = self.cusum.step(state.cusum, seen)
        drift, b = self.drift.step(state.drift, seen)
        snr, found = state.snr, a.records + self._begins(state.told, b.records)
        if self.use_snr:
            snr, c = self.snr.step(snr, seen)
            found += c.records
        if not found:
            return DetectState(cusum, drift, snr, state.told, state.pending), ()
        events = tuple(event for event in found if isinstance(event, Event))
        alarms = [e for e in events if e.kind != "not_calibrated"]
        pending = state.pending
        if alarms and not pending.kind:
            first = min(alarms, key=lambda e: e.row)
            pending = Alarm(first.kind, first.signal, first.reason, first.row)
        others = tuple(e for e in events if e.kind == "not_calibrated")
        return DetectState(cusum, drift, snr, state.told, pending), others

    def _begins(self, told: np.ndarray, records: tuple[Record, ...]) -> tuple[Record, ...]:
        """Drifts that begin an excursion; what follows within `QUIET` rows belongs to it."""
        kept: list[Record] = []
        for record in records:
            if isinstance(record, Event):
                k = self.drift.names.index(record.signal)
                if record.row - told[k] >= QUIET:
                    kept.append(record)
                told[k] = record.row
        return tuple(kept)

    def quiet(self, state: DetectState) -> bool:
        """Has a beat nothing to do for the detectors until one of them alarms?"""
        ready = state.cusum.calibration.ready and state.drift.calibration.ready
        return ready and not state.pending.kind

    def beat(
        self, state: DetectState, task_end: bool = False
    ) -> tuple[DetectState, tuple[str, int]]:
        """At a beat: calibrations made and handed on, and why one that was due failed (with its
        rows; empty: none did)."""
        failed = ("", 0)
        if self._due(state, task_end):
            cusum, reason = self.cusum.settle(state.cusum)
            rows = state.cusum.collected
            state, failed = state._replace(cusum=cusum, tried=rows), (reason, rows)
        known = state.cusum.calibration
        if known.ready and not state.drift.calibration.ready:
            state = state._replace(drift=self.drift.begin(known), snr=self.snr.begin(known))
        return state, failed

    def _due(self, state: DetectState, task_end: bool) -> bool:
        """Has the span passed? After a failure: have as many rows again come?"""
        rows, t = state.cusum.collected, state.cusum.calm.t
        if self.calibration == 0 or state.cusum.calibration.ready or rows == 0:
            return False
        span = float(t[rows - 1] - t[0]) * 1e-9
        enough = task_end if math.isinf(self.calibration) else span >= self.calibration
        return enough and rows >= min(2 * state.tried, self.cusum.capacity)
