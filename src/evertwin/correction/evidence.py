"""What a correction is judged on: predictions over one horizon, segment by segment.

Recorded windows are simulated from the measured state, restarted after every horizon. Of each
segment a few rows are kept, and its deviation is the rms of their scaled residuals. Folds are runs
of whole segments, dealt out in turn, so that what is held out is never the neighbour of a row in
the same manoeuvre alone.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> rows = make_block(t=np.arange(9) * 10**9, u=np.ones((9, 1)), y=1.1 * np.arange(9)[:, None])
>>> seen = gather(Robot1D(), (rows,), horizon=2.0)
>>> seen.segments, seen.deviations(seen.residual(Robot1D(), np.array([1.1]))).round(6).tolist()
(4, [0.0, 0.0, 0.0, 0.0])
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evertwin.errors import TooFew, UsageError
from evertwin.fold import Block
from evertwin.models import Model, Restart, observed, remembers
from evertwin.models.batch import Batch
from evertwin.models.kernels.kernel import ANEW
from evertwin.signals import wrap
from evertwin.sync import residuals, restarts
from evertwin.types import (
    Bools,
    Float64,
    Inputs,
    Int64,
    Intervals,
    Outputs,
    ParameterVector,
    Vector,
)

SAMPLES = 4
"""Rows of each segment that are looked at, evenly spread, its last among them."""
RUN = 5
"""Neighbouring segments that go into one fold together."""
FOLDS = 10
FEW = 4
"""Recordings of fewer segments than so many times those that are left out keep them."""
TOGETHER = 16
"""Parameter vectors that are simulated at once: all rows of each are held."""
FAILED = 1e3
"""Scaled residual of a row that could not be predicted."""


@dataclass(frozen=True)
class Evidence:
    """Windows prepared for scoring; `gather` builds it.

    >>> Evidence.__name__      # see the module
    'Evidence'
    """

    u: Inputs
    """Inputs of all windows, one after another."""
    dt: Intervals
    code: np.ndarray
    """Restart code of every row; each window starts anew."""
    adopts: Outputs
    """What each restart takes over."""
    rows: Int64[np.ndarray, " m"]
    """Rows that are looked at."""
    measured: Float64[np.ndarray, "m ny"]
    """What was measured there, (m, ny)."""
    segment: Int64[np.ndarray, " m"]
    """Segment of each of these rows."""
    since: Int64[np.ndarray, " m"]
    """Segments of its recording before that one."""
    known: Float64[np.ndarray, "m ny"]
    """1 where measured and trusted, else 0."""
    scale: Vector
    """Size that counts as 1, per output, (ny,)."""
    horizon: float
    """Length of a prediction, at most the longest window [s]."""
    observes: bool = False
    """Are states that nothing measures estimated? Else they begin as the numbers say."""

    @property
    def segments(self) -> int:
        """How many."""
        return int(self.segment[-1]) + 1

    @property
    def fold(self) -> Int64[np.ndarray, " m"]:
        """Fold of each row looked at."""
        folds = min(FOLDS, max(2, self.segments // 2))
        run = RUN if self.segments >= RUN * folds else 1
        return self.segment // run % folds

    @property
    def opening(self) -> Int64[np.ndarray, " m"]:
        """The recording of each row looked at, from 1."""
        return np.cumsum(np.diff(self.segment, prepend=-1) * (self.since == 0))

    def settled(self, segments: int) -> Evidence:
        """Without the first ``segments`` of each recording, by which a state that nothing measures
        is estimated; of one that has few, with them."""
        opening = self.opening
        most = np.zeros(int(opening.max()) + 1, dtype=np.int64)
        np.maximum.at(most, opening, self.since + 1)
        kept = (self.since >= segments) | (most[opening] < FEW * segments)
        return replace(
            self, rows=self.rows[kept], measured=self.measured[kept], since=self.since[kept],
            known=self.known[kept], segment=np.unique(self.segment[kept], return_inverse=True)[1],
            observes=True,
        )  # fmt: skip

    def residual(self, model: Model, p: ParameterVector) -> Float64[np.ndarray, "m ny"]:
        """Scaled residuals of the rows looked at, (m, ny); 0 where nothing is known."""
        (found,) = self.residuals(model, p[None])
        return found

    def residuals(
        self, model: Model, p: Float64[np.ndarray, "k np"]
    ) -> list[Float64[np.ndarray, "m ny"]]:
        """`residual` of several parameter vectors at once."""
        if self.observes:
            model = observed(model, np.asarray(self.known.any(axis=0)))
        restart, batch = Restart(self.adopts, self.code, model.initial(p[0])), Batch(model)
        scaled: list[Float64[np.ndarray, "m ny"]] = []
        for part in np.array_split(p, -(-len(p) // TOGETHER)):
            runs = batch.run(self.u, self.dt, part, restart)[:, self.rows]
            scaled += [wrap(self.measured - y, model.outputs.angles) / self.scale for y in runs]
        bounded = [np.where(np.isfinite(r), np.clip(r, -FAILED, FAILED), FAILED) for r in scaled]
        return [np.where(self.known > 0.0, r, 0.0) for r in bounded]

    def deviations(self, residual: Float64[np.ndarray, "m ny"]) -> Vector:
        """Rms of each segment's scaled residuals, (segments,)."""
        square = np.bincount(self.segment, (residual**2).sum(axis=1), self.segments)
        count = np.bincount(self.segment, self.known.sum(axis=1), self.segments)
        return np.sqrt(square / np.maximum(count, 1.0))


def mean_deviation(deviations: Vector) -> float:
    """One figure: the mean over segments."""
    return float(deviations.mean())


def gather(
    model: Model,
    windows: Sequence[Block],
    horizon: float,
    scale: Vector | None = None,
    p: ParameterVector | None = None,
    outputs: Sequence[str] = (),
) -> Evidence:
    """Prepares windows for scoring.

    Args:
        model: gives the outputs and, with ``p``, the scale when none is given: the rms of its
            residuals, one for all outputs of one unit.
        horizon: length of a prediction [s].
        outputs: those that count; empty: all.

    Raises:
        TooFew: fewer than four segments can be judged.
        UsageError: the model is a static map, which corrections of the input do not apply to.
    """
    values = model.parameters.values if p is None else p
    x0 = model.initial(values)
    if len(x0) == 0:
        raise UsageError("correction: expected a model with states, got a static map: tune it")
    reach = min(horizon, max(float(w.t[-1] - w.t[0]) * 1e-9 for w in windows))
    plans = [restarts(w, horizon, x0, remembers(model)) for w in windows]
    asked = asked_of(model, outputs)
    known = [np.isfinite(residuals(model, w, np.zeros_like(w.y))) & asked for w in windows]
    rows, segment, since, count, offset = [], [], [], 0, 0
    for window, plan, usable in zip(windows, plans, known, strict=True):
        chosen, numbers, begun = _choose(window, plan.code, usable.any(axis=1), reach)
        since.append(begun)
        rows.append(chosen + offset)
        segment.append(numbers + count)
        count += int(numbers[-1]) + 1 if len(numbers) else 0
        offset += len(window.t)
    if count < 4:
        raise TooFew(
            f"correction: expected at least 4 segments of {reach:g} s with measured outputs, got "
            f"{count}: give more data or a shorter horizon"
        )
    looked = np.concatenate(rows)
    evidence = Evidence(
        np.concatenate([w.u for w in windows]), np.concatenate([w.dt for w in windows]),
        np.concatenate([plan.code for plan in plans]), np.concatenate([plan.y for plan in plans]),
        looked, np.concatenate([w.y for w in windows])[looked], np.concatenate(segment),
        np.concatenate(since), np.concatenate(known)[looked].astype(np.float64),
        np.ones(len(model.outputs)), reach,
    )  # fmt: skip
    size = _scale(evidence, model, values) if scale is None else np.asarray(scale, dtype=np.float64)
    return replace(evidence, scale=size)


def asked_of(model: Model, outputs: Sequence[str]) -> Bools:
    """Which outputs count, (ny,).

    Raises:
        UsageError: the model has no such output.
    """
    for name in outputs:
        model.outputs.index(name)
    return np.array([not outputs or name in outputs for name in model.outputs.names])


def _choose(
    window: Block, code: np.ndarray, usable: Bools, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows looked at in one window, their segments from 0, and those since it began anew."""
    starts, last = [], -math.inf
    seconds = (window.t - window.t[0]) * 1e-9
    for i in np.flatnonzero(code):
        if code[i] >= ANEW or seconds[i - 1] - last >= reach - 1e-6:
            starts.append(i)
            last = seconds[i] if code[i] >= ANEW else seconds[i - 1]
    rows: list[int] = []
    segment: list[int] = []
    since, passed = list[int](), 0
    for begin, end in zip(starts, [*starts[1:], len(code)], strict=True):
        passed = 0 if code[begin] >= ANEW else passed
        found = np.flatnonzero(usable[begin:end] & (code[begin:end] < ANEW)) + begin
        if len(found) == 0 or seconds[found[-1]] - seconds[max(begin - 1, 0)] < 0.5 * reach:
            continue
        places = np.linspace(0, len(found), min(SAMPLES, len(found)) + 1)[1:].astype(int) - 1
        segment += [segment[-1] + 1 if segment else 0] * len(places)
        since += [passed] * len(places)
        passed += 1
        rows += found[places].tolist()
    told = rows, segment, since
    return tuple(np.array(one, dtype=np.int64) for one in told)  # type: ignore[return-value]


def _scale(evidence: Evidence, model: Model, p: ParameterVector) -> Vector:
    """Rms of the residuals, pooled over outputs of one unit; never zero."""
    square = (evidence.residual(model, p) ** 2).sum(axis=0)
    count = evidence.known.sum(axis=0)
    units = np.array(model.outputs.units)
    rms = [
        math.sqrt(square[units == unit].sum() / max(count[units == unit].sum(), 1.0))
        for unit in units
    ]
    return np.array([value if value > 0.0 else 1.0 for value in rms])
