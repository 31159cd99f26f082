"""Phases: the operating regimes, and the steps of a repeating task, each with its own statistics.

A residual that is usual while the heater runs is not usual while it rests. Rows are therefore put
into phases, and every limit is set per phase (`evertwin.anomaly.calibration`). `Regimes` cluster by
the values of channels, `TaskSteps` by the time since the task began, for work that repeats.

>>> regimes = Regimes.found(np.array([[0.0], [1.0], [0.0], [1.0]]), bins=8)
>>> regimes.count, regimes.of(np.array([[1.0], [0.2], [np.nan]])).tolist()
(2, [1, 0, -1])
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.errors import UsageError
from evertwin.types import Outputs, Stamps, Tasks


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


@dataclass(frozen=True)
class TaskSteps:
    """Steps of a repeating task: equal parts of its duration, counted from its first row.

    >>> TaskSteps(duration=4.0, parts=2).of(np.arange(6) * 10**9, began=0).tolist()
    [0, 0, 1, 1, 1, 1]
    """

    duration: float = 1.0
    """Duration of one task [s]; what lasts longer stays in the last step."""
    parts: int = 1

    def named(self, step: int) -> str:
        """Which of the steps it is, and when in a task.

        >>> TaskSteps(duration=60.0, parts=6).named(2)
        'step 3 of 6 (20 to 30 s of each task)'
        """
        first, last = (self.duration * k / self.parts for k in (step, step + 1))
        return f"step {step + 1} of {self.parts} ({first:.4g} to {last:.4g} s of each task)"

    def of(self, t: Stamps, began: int) -> Tasks:
        """The step of each row of a task that began at a stamp [ns]."""
        if self.parts == 1:
            return np.zeros(len(t), dtype=np.int64)
        part = (t - began) * (1e-9 * self.parts / self.duration)
        return np.minimum(part, self.parts - 1).astype(np.int64)
