"""How well a version predicts given windows: the figures of `fit`, `compare` and the report.

Deviation per output is ``rms(measured − predicted) / rms(measured)``, after the same filter on both
sides, over all rows and over moving rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from evertwin.fold import Block
from evertwin.models import Model, Restart, observed, remembers
from evertwin.models.batch import Batch, mapped
from evertwin.models.form import Size
from evertwin.setup.deviation import usual_of
from evertwin.setup.setup import Setup
from evertwin.signals.sizes import rms, size
from evertwin.signals.spoken import in_recorded
from evertwin.sync.horizon.horizon import residuals, restarts
from evertwin.tuning import Fit, Problem
from evertwin.tuning.posing.before import begins
from evertwin.types import Float64, Json, Outputs, ParameterVector, PerOutput, StateVector, Vector

ENDS = 4
"""Of fewer predictions each row counts: where one or two of them end is luck."""


@dataclass(frozen=True)
class Prediction:
    """One window, measured and predicted, both filtered.

    >>> Prediction.__name__
    'Prediction'
    """

    window: Block
    measured: Outputs
    predicted: Outputs
    residual: Outputs
    """measured − predicted, angles wrapped; NaN where either is unknown."""
    moving: np.ndarray


def predict(
    setup: Setup, model: Model, p: ParameterVector, window: Block, before: Sequence[Block] = (),
    start: StateVector | None = None,
) -> Prediction:  # fmt: skip
    """A version's predictions of one window over the twin's horizon.

    Args:
        before: rows before it, which tell what it begins with.
        start: what it begins with, NaN where that, or the model, tells it, (nx,).
    """
    if len(model.states):
        seen = observed(model, np.isfinite(window.y).any(axis=0))
        x0 = seen.initial(p)
        begun = begins(model, p, setup.horizon, (before, (window,))).get(window.row)
        if begun is not None:
            x0[: len(begun)] = begun
        if start is not None:
            x0[: len(start)] = np.where(np.isnan(start), x0[: len(start)], start)
        plan = restarts(window, setup.horizon, x0, remembers(seen))
        y = Batch(seen).run(window.u, window.dt, p[None], plan, x0[None])[0]
    else:
        y = mapped(model, window.u, window.dt, p)
    residual = residuals(model, window, y)
    measured = np.where(np.isnan(residual), np.nan, window.y)
    smooth = setup.smooth_window
    if smooth is not None:
        residual, measured, y = smooth(residual), smooth(measured), smooth(y)
    return Prediction(window, measured, y, residual, setup.moving(window.u))


@dataclass(frozen=True)
class Deviation:
    """Figures of one output.

    >>> Deviation("tau1", "Nm", 0.5, 0.05, 0.04, 400, 500).to_dict()["moving"]
    400
    """

    name: str
    unit: str
    rms: float
    relative_rms: float
    relative_rms_moving: float
    moving: int
    """Moving rows."""
    rows: int
    recorded: str = ""
    """The unit that people are told it in."""

    @property
    def told(self) -> tuple[float, str]:
        """The rms as people are told it, and its unit."""
        unit, factor = in_recorded(self.unit, self.recorded)
        return self.rms * factor, unit

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        return {
            "unit": self.unit, "rms": self.rms, "relative_rms": self.relative_rms,
            "relative_rms_moving": self.relative_rms_moving, "moving": self.moving,
            "samples": self.rows,
        }  # fmt: skip


def deviations(setup: Setup, predictions: Sequence[Prediction]) -> tuple[Deviation, ...]:
    """Figures per output over all windows together."""
    channels = setup.model.outputs.channels
    residual = np.concatenate([p.residual for p in predictions])
    measured = np.concatenate([p.measured for p in predictions])
    moving = np.concatenate([p.moving for p in predictions])
    found = []
    signals, warm = setup.spec.signals, setup.model.outputs.temperatures
    for k, channel in enumerate(channels):
        if channel.name in signals and not signals[channel.name].judge:
            continue
        known = ~np.isnan(residual[:, k])
        moves = known & moving[:, k]
        found.append(
            Deviation(
                channel.name,
                channel.unit,
                _rms(residual[known, k]),
                _rms(residual[known, k]) / size(measured[known, k], bool(warm[k])),
                _rms(residual[moves, k]) / size(measured[moves, k], bool(warm[k])),
                int(moves.sum()),
                int(known.sum()),
                setup.recorded[k],
            )
        )
    return tuple(found)


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def seen_sizes(setup: Setup, predictions: Sequence[Prediction]) -> tuple[Size, ...]:
    """How large outputs were on the rows of these windows that count as those of a run do."""
    found = []
    for one in predictions:
        ahead = setup.horizon / float(np.median(one.window.dt)) if setup.at_horizon.wanted else 1.0
        found.append(np.where(one.moving, one.measured, np.nan)[:: max(round(ahead), 1)])
    usual, outputs = usual_of(np.concatenate(found), setup.model.outputs.temperatures), []
    for k, name in enumerate(setup.model.outputs.names):
        low, high = np.nan_to_num([usual.lowest[k], usual.highest[k]]).tolist()
        if usual.samples[k]:
            squares, jumps = float(usual.measured[k]), float(usual.jumps[k])
            outputs.append(Size(name, int(usual.samples[k]), squares, low, high, jumps))
    return tuple(outputs)


def at_ends(problem: Problem, values: np.ndarray) -> PerOutput:
    """Rms residual per output where a prediction has reached its horizon."""
    return rms(_newest(problem.residuals(values), problem.restart), 0.0)


def _newest(residual: Outputs, plan: Restart) -> Float64[np.ndarray, "predictions ny"]:
    """The newest known residual of each prediction, which goes from one restart to the next."""
    bounds = [*np.flatnonzero(plan.code).tolist(), len(residual)]
    newest = np.full((len(bounds) - 1, residual.shape[1]), np.nan)
    for n, (start, stop) in enumerate(pairwise(bounds)):
        for k in range(residual.shape[1]):
            known = residual[start:stop, k][~np.isnan(residual[start:stop, k])]
            newest[n, k] = known[-1] if len(known) else np.nan
    return newest


def judged(
    setup: Setup, model: Model, p: ParameterVector, windows: Sequence[Block], skip: int = 0
) -> PerOutput:
    """What each output is off by, as the requirement has it: of rows that move, of predictions
    that have reached their horizon; NaN where nothing was measured.

    ``skip``: rows of the first window that others were measured in.
    """
    seen = [predict(setup, model, p, window) for window in windows]
    return as_required(setup, model, p, seen, skip)


def as_required(
    setup: Setup, model: Model, p: ParameterVector, found: Sequence[Prediction], skip: int = 0
) -> PerOutput:
    """`judged` of windows that were predicted."""
    found_in, measured, ends = [np.zeros((0, len(model.outputs)))], list[Outputs](), list[Outputs]()
    for k, seen in enumerate(found):
        window = seen.window
        counts = seen.moving & (np.arange(len(window.t)) >= (0 if k else skip))[:, None]
        off = np.where(counts, seen.residual, np.nan)
        measured.append(np.where(counts, seen.measured, np.nan))
        found_in.append(off)
        if setup.at_horizon.wanted:
            ends.append(_newest(off, restarts(window, setup.horizon, model.initial(p))))
    enough = sum(map(len, ends)) >= ENDS
    off = np.concatenate(ends if enough else found_in)
    return np.asarray(rms(off) / setup.sizes(np.concatenate(measured)))


def falls_short(setup: Setup, problem: Problem, fit: Fit, noise: PerOutput | None = None) -> str:
    """Which output stays outside the requirement after tuning, and above what ``noise`` makes of
    it; empty where all reach it."""
    least = np.zeros(len(setup.watched)) if noise is None else noise
    for k, left in enumerate(off_after(setup, problem, fit)):
        if setup.watched[k] and left > max(setup.requirement, least[k]):
            name, limit = fit.residuals[k].output, setup.shown(k, setup.requirement)
            return f"tuned, {name} is still off by {setup.shown(k, left)} (limit {limit})"
    return ""


def off_after(setup: Setup, problem: Problem, fit: Fit) -> PerOutput:
    """What each output is off by after tuning, as the requirement has it."""
    if setup.relative:
        return np.asarray(fit.moving_after, dtype=np.float64)
    if setup.at_horizon.wanted:
        return at_ends(problem, fit.values)
    return np.array([one.rms_after for one in fit.residuals])


def rms_asked(setup: Setup, problem: Problem, fit: Fit) -> PerOutput:
    """Rms residual of an output that is off by just what is asked; 0: nothing is asked of it."""
    off, rms = off_after(setup, problem, fit), np.array([one.rms_after for one in fit.residuals])
    held = setup.watched & np.isfinite(setup.requirement) & (off > 0.0)
    asked = np.where(held, setup.requirement, 0.0)
    return np.asarray(asked * rms / np.where(held, off, 1.0))


LEAST, LITTLE = 0.05, 0.1
"""Smallest size of an output's loss, by that of the version before: few rows leave too little; and
the weight in a loss of an output that nothing is explained of, 1: of one that is explained."""


def scale_of(before: PerOutput, after: PerOutput) -> PerOutput:
    """What counts as 1 in the losses of a trial; what was not off counts little: it would hide how
    much another output gains.

    Args:
        before: rms residual of the live version per output, (ny,).
        after: of the candidate.

    >>> scale_of(np.array([2.0, 1.0]), np.array([0.5, 1.0])).round(2).tolist()
    [0.52, 3.16]
    """
    after = np.clip(after, LEAST * before, before)
    return np.asarray(after / np.sqrt(np.maximum(1.0 - (after / before) ** 2, LITTLE)))


def sizes(setup: Setup, problem: Problem, values: Vector) -> PerOutput:
    """Rms residual per output: what counts as 1 in a loss, unless the twin file says."""
    given = setup.spec.prediction.scale
    left = rms(np.where(problem.rows.used, problem.residuals(values), np.nan))
    found = [given.get(n, float(left[k])) for k, n in enumerate(problem.model.outputs.names)]
    return np.array([size if np.isfinite(size) and size > 0 else 1.0 for size in found])


def left(
    setup: Setup, model: Model, p: ParameterVector, windows: Sequence[Block],
    before: Sequence[Block] = (),
) -> PerOutput:  # fmt: skip
    """Rms residual per output of a version, of rows that move; NaN where nothing was measured.
    ``before``: rows before them, which tell what states that nothing measures had come to."""
    seen = [predict(setup, model, p, window, before) for window in windows]
    return rms(np.concatenate([np.where(one.moving, one.residual, np.nan) for one in seen]))
