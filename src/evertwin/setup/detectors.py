"""The detectors of a twin over released rows: CUSUM, drift, signal to noise, on one calibration.

They begin silent. The CUSUM collects calm rows and calibrates itself; the others start from its
calibration at the next beat, so that where rows are cut cannot matter. A new champion has other
residuals: everything begins anew with it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from evertwin.anomaly import (
    Calm,
    Cusum,
    CusumState,
    Drift,
    DriftState,
    Level,
    Residuals,
    Rise,
    SnrLimit,
    SnrState,
    TaskSteps,
)
from evertwin.anomaly.drift import KINDS
from evertwin.anomaly.run_length import run_length
from evertwin.config.spec import AnomalySpec
from evertwin.fold import Event, Record
from evertwin.setup.released import Released
from evertwin.signals import Layout

FEW, WORTH, CUT = 300, 100.0, 4.0
"""Residuals that calibrate at least, however long a prediction is, and what they must be worth; so
few do not tell how far single ones lie out, which are cut there."""
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
    detector: str = ""
    """``cusum``, ``drift`` or ``snr``."""
    of: str = ""
    """What of the residual has drifted."""
    value: float = 0.0
    """To how many standard deviations."""
    step: int = 0
    """In which step of a repeating task, from 1 on; 0: there are none."""

    @property
    def evidence(self) -> dict[str, Any]:
        """What an event of it says."""
        told: dict[str, Any] = {"row": self.row, "detector": self.detector}
        told |= {"step": self.step} if self.step else {}
        return told | ({"of": self.of, "value": self.value} if self.of else {})


class DetectState(NamedTuple):
    """States of the detectors, and what was not yet acted on.

    >>> DetectState._fields
    ('cusum', 'drift', 'snr', 'told', 'pending', 'false', 'calm',
    'since', 'watched', 'level', 'risen', 'tried')
    """

    cusum: CusumState
    drift: DriftState
    snr: SnrState
    told: np.ndarray
    """Row of each output's newest drift, int64: one event tells of an excursion."""
    pending: Alarm
    """The oldest alarm that was not yet acted on."""
    false: np.ndarray
    """Alarms of each output that a person called false, by its CUSUM and by its drift detector,
    int64 (ny, 2); of every champion, as it is the machine that gives them."""
    calm: np.ndarray
    """What they reached, which is no alarm again, in standard deviations, (ny, 3): the sum of the
    CUSUM, and to what mean and spread a drift went."""
    since: np.ndarray
    """Rows that had been watched at the newest of them, int64 (ny, 2)."""
    watched: int
    """Rows in which alarms could come."""
    level: np.ndarray
    """What each output is usually off by (`evertwin.anomaly.level`)."""
    risen: Rise
    """The newest rise of that which was not yet acted on."""
    tried: int = 0
    """Calm rows at the last attempt to calibrate on a span that the twin file sets."""


@dataclass(frozen=True)
class Detect:
    """The detectors together. Built by `Detect.of`.

    >>> Detect.of(AnomalySpec(), Layout.of(x="m"), np.array([True]), 1).columns
    (0,)
    """

    cusum: Cusum
    drift: Drift
    snr: SnrLimit
    level: Level
    columns: tuple[int, ...]
    """Outputs that are watched."""
    use_snr: bool
    calibration: float = 0.0
    """Span of calm data that calibrates [s]; 0: as soon as it suffices; inf: the first task."""
    steps: TaskSteps = TaskSteps()
    """Of a task that repeats."""

    @classmethod
    def of(
        cls, spec: AnomalySpec, outputs: Layout, watched: np.ndarray, phases: int,
        rows: int = 1,
    ) -> Detect:  # fmt: skip
        """As the twin file says. ``rows`` from residual to residual: so many fewer calibrate, as
        it is of the machine that enough has to be seen."""
        columns = tuple(int(k) for k in np.flatnonzero(watched))
        chosen = tuple(outputs.names[k] for k in columns)
        calm = Calm(false_alarms_per_month=spec.false_alarms_per_month)
        if rows > 1:
            calm = replace(calm, least=max(calm.least // rows, FEW), independent=WORTH, clip=CUT)
        limit = SnrLimit(chosen, spec.snr or 6.0, phases=phases, orders=calm.orders)
        return cls(
            Cusum(chosen, calm, phases), Drift(chosen, phases=phases, orders=calm.orders), limit,
            Level.of(outputs, watched), columns, spec.snr > 0, spec.calibration,
        )  # fmt: skip

    def init(self) -> DetectState:
        """Nothing calibrated."""
        ny = len(self.columns)
        told, none = np.full(ny, -QUIET, dtype=np.int64), np.zeros((ny, 2), dtype=np.int64)
        return DetectState(
            self.cusum.init(), self.drift.init(), self.snr.init(), told, Alarm(), none,
            np.zeros((ny, 3)), none.copy(), 0, self.level.init(), Rise(),
        )  # fmt: skip

    def anew(self, state: DetectState) -> DetectState:
        """Nothing calibrated; what was called false counts on."""
        return self.init()._replace(
            false=state.false.copy(), calm=state.calm.copy(), since=state.since.copy(),
            watched=state.watched,
        )  # fmt: skip

    def step(self, state: DetectState, rows: Released) -> tuple[DetectState, tuple[Event, ...]]:
        """More rows; consumes ``state``."""
        counts = rows.moving & ~rows.outside[:, None]
        level, risen = self.level.step(state.level, rows.row, rows.live, counts, rows.end)
        return self._limits(state._replace(level=level, risen=(state.risen, *risen)[-1]), rows)

    def _limits(self, state: DetectState, rows: Released) -> tuple[DetectState, tuple[Event, ...]]:
        """What is beyond what was calm."""
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
        if state.drift.calibration.ready:  # since a beat, so that where rows are cut cannot matter
            state = state._replace(watched=state.watched + len(seen.row))
        cusum, a = self.cusum.step(state.cusum, seen)
        drift, b = self.drift.step(state.drift, seen)
        snr, found = state.snr, a.records + self._begins(state, b.records)
        if self.use_snr:
            snr, c = self.snr.step(snr, seen)
            found += c.records
        if not found:
            return state._replace(cusum=cusum, drift=drift, snr=snr, tried=0), ()
        events = tuple(event for event in found if isinstance(event, Event))
        alarms = [e for e in events if e.kind != "not_calibrated"]
        pending = state.pending
        if alarms and not pending.kind:
            first = min(alarms, key=lambda e: e.row)
            pending = _alarm(first, self.steps)
        others = tuple(e for e in events if e.kind == "not_calibrated")
        return state._replace(cusum=cusum, drift=drift, snr=snr, pending=pending, tried=0), others

    def _begins(self, state: DetectState, records: tuple[Record, ...]) -> tuple[Record, ...]:
        """Drifts that begin an excursion; what follows within `QUIET` rows belongs to it. Those
        that go no farther than one that was called false are none."""
        kept: list[Record] = []
        for record in records:
            if isinstance(record, Event):
                found: Any = record.evidence
                k = self.drift.names.index(record.signal)
                if abs(found["value"]) <= state.calm[k, 1 + KINDS.index(found["of"])]:
                    continue
                if record.row - state.told[k] >= QUIET:
                    kept.append(record)
                state.told[k] = record.row
        return tuple(kept)

    def lasts(self, state: DetectState) -> bool:
        """Is an output beyond what was calm, and has not been back since?"""
        return bool(self.cusum.on(state.cusum))

    def quiet(self, state: DetectState) -> bool:
        """Has a beat nothing to do for the detectors until one of them alarms?"""
        ready = state.cusum.calibration.ready and state.drift.calibration.ready
        return ready and not state.pending.kind and not state.risen.name

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
            limit = state.cusum.calibration.limit
            np.maximum(limit, state.calm[:, 0], out=limit)
        return state, failed

    def mistaken(
        self, state: DetectState, signal: str, found: Mapping[str, Any]
    ) -> tuple[DetectState, str]:
        """An alarm was false, and the sentence that says what follows. Consumes ``state``.

        What it reached is calm: so much is no alarm again. A CUSUM's limit is set so, too, that
        false alarms which come sooner after each other than is allowed on average would have come
        as seldom (`evertwin.anomaly.run_length`). Where what is called false goes on, what is calm
        is learned anew.

        Args:
            state: with the alarm behind it.
            signal: output that it was of.
            found: evidence of its event.
        """
        k, drifts = self.cusum.names.index(signal), found["detector"] == "drift"
        state.false[k, int(drifts)] += 1
        passed, known = state.watched - int(state.since[k, int(drifts)]), state.cusum.calibration
        state.since[k, int(drifts)] = state.watched
        told = f"false alarm {state.false[k].sum()} of {signal}"
        if not known.ready:
            return state, f"{told}: its detectors are not calibrated now"
        calm = self.cusum.calm
        streams = len(self.columns) * calm.twins
        allowed = run_length(calm.false_alarms_per_month, known.interval, streams)
        told = f"{told}, after {passed} rows ({allowed:.3g} are allowed on average)"
        if drifts:
            of = 1 + KINDS.index(found["of"])
            state.calm[k, of] = max(state.calm[k, of], abs(found["value"]))
            told = f"{told}: a {found['of']} of {state.calm[k, of]:.3g} σ is no drift again"
        else:
            limit, more = float(known.limit[k]), math.log(max(allowed / max(passed, 1), 1.0))
            new = max(limit + more / float(known.steep[k]), float(state.cusum.peak[k]))
            known.limit[k] = state.calm[k, 0] = new
            told = f"{told}: the limit of its CUSUM goes from {limit:.3g} to {new:.3g} σ"
        if state.cusum.seen[k, 1] < 0:
            return state, told
        return self.anew(state), f"{told}; as it goes on, what is calm is learned anew"

    def _due(self, state: DetectState, task_end: bool) -> bool:
        """Has the span passed? After a failure: have as many rows again come?"""
        rows, t = state.cusum.collected, state.cusum.calm.t
        if self.calibration == 0 or state.cusum.calibration.ready or rows == 0:
            return False
        span = float(t[rows - 1] - t[0]) * 1e-9
        enough = task_end if math.isinf(self.calibration) else span >= self.calibration
        return enough and rows >= min(2 * state.tried, self.cusum.capacity)


def _alarm(event: Event, steps: TaskSteps) -> Alarm:
    """What a detector's event says, and in which of the steps."""
    found: Any = event.evidence
    usual = "drift" if event.kind == "drift" else "cusum"
    step, reason = 0, event.reason
    if steps.parts > 1 and found.get("phase", -1) >= 0:
        step = found["phase"] % steps.parts + 1
        reason = f"in {steps.named(step - 1)} {reason}"
    return Alarm(
        event.kind, event.signal, reason, event.row, found.get("detector", usual),
        found.get("of", ""), found.get("value", 0.0), step,
    )  # fmt: skip
