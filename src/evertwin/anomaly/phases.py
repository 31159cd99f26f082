"""Phases: the operating regimes, or the steps of a repeating task, each with its own statistics.

A residual that is usual while the heater runs is not usual while it rests. Rows are therefore put
into phases, and every limit is set per phase. `Regimes` cluster by the values of channels;
`TaskSteps` by the time since the task began, for work that repeats. `PhaseStats` keeps count, mean
and variance per phase (Welford's update, in the order of the rows).

>>> regimes = Regimes.found(np.array([[0.0], [1.0], [0.0], [1.0]]), bins=8)
>>> regimes.count, regimes.of(np.array([[1.0], [0.2], [np.nan]])).tolist()
(2, [1, 0, -1])
>>> stats = PhaseStats(phases=2, outputs=1)
>>> state, _ = stats.step(stats.init(), Residuals.of(np.array([[1.0], [3.0]]), 1.0))
>>> state.mean[0, 0], stats.deviation(state)[0, 0].round(3)
(np.float64(2.0), np.float64(1.414))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from evertwin.anomaly.residuals import Residuals
from evertwin.errors import UsageError
from evertwin.fold import Block, Out
from evertwin.types import Float64, Int64, Outputs, Tasks

__all__ = ["PhaseState", "PhaseStats", "Regimes", "TaskSteps"]


@dataclass(frozen=True)
class Regimes:
    """Phases by the values of channels: bins along each, all combinations.

    >>> Regimes(((0.5,), (1.0, 2.0))).count
    6
    """

    edges: tuple[tuple[float, ...], ...] = ()
    """Borders along each channel, increasing; a value on a border belongs above it."""

    def __post_init__(self) -> None:
        for border in self.edges:
            if list(border) != sorted(set(border)):
                raise UsageError(f"phases: expected increasing borders, got {border}")

    @classmethod
    def found(cls, values: Outputs, bins: int) -> Regimes:
        """Regimes that the data shows: levels where a channel has few, else equal shares.

        Args:
            values: channels that define the phase, (n, k); rows with NaN are left out.
            bins: most phases along one channel.
        """
        known = values[np.isfinite(values).all(axis=1)]
        if len(known) == 0 or bins < 1:
            raise UsageError("phases: expected at least one finite row and one bin")
        return cls(tuple(_borders(known[:, j], bins) for j in range(values.shape[1])))

    @property
    def count(self) -> int:
        """Number of phases."""
        return int(np.prod([len(border) + 1 for border in self.edges], dtype=np.int64))

    def of(self, values: Outputs) -> Tasks:
        """The phase of each row of (n, k) values; −1 where one is not known."""
        phase = np.zeros(len(values), dtype=np.int64)
        for j, border in enumerate(self.edges):
            place = np.searchsorted(np.array(border), values[:, j], side="right")
            phase = phase * (len(border) + 1) + place
        phase[~np.isfinite(values[:, : len(self.edges)]).all(axis=1)] = -1
        return phase


def _borders(values: np.ndarray, bins: int) -> tuple[float, ...]:
    levels = np.unique(values)
    if len(levels) <= bins:
        return tuple((0.5 * (levels[1:] + levels[:-1])).tolist())
    shares = np.quantile(values, np.linspace(0, 1, bins + 1)[1:-1])
    return tuple(np.unique(shares).tolist())


class StepState(NamedTuple):
    """Task of the last row (−1: none yet) and the stamp at which it began [ns].

    >>> StepState(-1, 0).task
    -1
    """

    task: int
    began: int


@dataclass(frozen=True)
class TaskSteps:
    """Phases of a repeating task: equal parts of its duration, counted from its first row.

    >>> from evertwin.fold import make_block
    >>> steps = TaskSteps(duration=4.0, parts=2)
    >>> rows = make_block(t=np.arange(5) * 10**9, u=np.zeros((5, 1)), y=np.zeros((5, 1)))
    >>> steps.step(steps.init(), rows)[1].rows[0].tolist()
    [0, 0, 1, 1, 1]
    """

    duration: float
    """Duration of one task [s]; what lasts longer stays in the last phase."""
    parts: int

    def __post_init__(self) -> None:
        if not (self.duration > 0 and self.parts >= 1):
            raise UsageError("steps: expected a duration above 0 s and at least one part")

    def init(self) -> StepState:
        """No task has begun."""
        return StepState(-1, 0)

    def step(self, state: StepState, block: Block) -> tuple[StepState, Out]:
        """The phase of each row, (n,), as the only column of the rows."""
        opens = np.diff(block.task, prepend=np.int64(state.task)) != 0
        first = np.where(opens, np.arange(len(opens)), -1)
        latest = np.maximum.accumulate(first)
        began = np.where(latest >= 0, block.t[latest], state.began)
        part = np.floor((block.t - began) * 1e-9 / self.duration * self.parts)
        phase = np.minimum(part, self.parts - 1).astype(np.int64)
        return StepState(int(block.task[-1]), int(began[-1])), Out(Phase(phase))


class Phase(NamedTuple):
    """Rows of `TaskSteps`.

    >>> Phase(np.zeros(1, dtype=np.int64)).phase.tolist()
    [0]
    """

    phase: Tasks


class PhaseState(NamedTuple):
    """Statistics per phase and output, each (phases, ny).

    >>> PhaseState._fields
    ('samples', 'mean', 'square')
    """

    samples: Int64[np.ndarray, "phases ny"]
    mean: Float64[np.ndarray, "phases ny"]
    square: Float64[np.ndarray, "phases ny"]
    """Sum of squared differences from the mean."""


@njit(cache=True)
def _welford(r: Any, phase: Any, samples: Any, mean: Any, square: Any) -> None:
    for i in range(r.shape[0]):
        k = phase[i]
        if k < 0:
            continue
        for j in range(r.shape[1]):
            if r[i, j] != r[i, j]:
                continue
            samples[k, j] += 1
            before = r[i, j] - mean[k, j]
            mean[k, j] += before / samples[k, j]
            square[k, j] += before * (r[i, j] - mean[k, j])


@dataclass(frozen=True)
class PhaseStats:
    """The residual's statistics per phase, as a stage of the stream. See the module.

    >>> PhaseStats(phases=3, outputs=2).init().mean.shape
    (3, 2)
    """

    phases: int
    outputs: int

    def init(self) -> PhaseState:
        """Nothing seen."""
        shape = (self.phases, self.outputs)
        return PhaseState(np.zeros(shape, dtype=np.int64), np.zeros(shape), np.zeros(shape))

    def step(self, state: PhaseState, block: Residuals) -> tuple[PhaseState, Out]:
        """Consumes ``state``; phases outside ``phases`` are a `UsageError`."""
        if len(block.phase) and int(block.phase.max()) >= self.phases:
            raise UsageError(f"phases: expected below {self.phases}, got {block.phase.max()}")
        _welford(block.r, block.phase, *state)
        return state, Out()

    def deviation(self, state: PhaseState) -> Float64[np.ndarray, "phases ny"]:
        """Standard deviation per phase; NaN below two samples."""
        free = np.where(state.samples > 1, state.samples - 1.0, np.nan)
        return np.asarray(np.sqrt(state.square / free), dtype=np.float64)
