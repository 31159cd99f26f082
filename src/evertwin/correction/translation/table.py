"""The translation table: from the set-point's level to the value that the machine effectively does.

A level keeps its own value until the best action is one that was tried: a half-learned table must
not be worse than none. Among actions of equal value the least mean deviation decides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.correction.translation.sarsa_settings import SarsaSettings
from evertwin.types import Bool, Float64, Int64, Vector


@dataclass(frozen=True)
class Table:
    """A translation table with what it rests on.

    >>> table = Table("v", np.array([0.0, 0.1]), np.array([0.0, 0.06]), np.array([0, 5]),
    ...     np.array([np.nan, 0.002]), np.array([False, True]))
    >>> table.translate(np.array([0.04, 0.08])).tolist()
    [0.0, 0.06]
    """

    channel: str
    levels: Float64[np.ndarray, " levels"]
    """Set-points, rising."""
    values: Float64[np.ndarray, " levels"]
    """What the simulation is given instead."""
    visits: Int64[np.ndarray, " levels"]
    """Samples per level."""
    deviation: Float64[np.ndarray, " levels"]
    """Mean deviation of the chosen action; NaN where none was tried."""
    learned: Bool[np.ndarray, " levels"]
    """True where the best action was tried; the others keep their level."""

    def translate(self, command: Vector) -> Vector:
        """The table's value at the level nearest to each set-point, (k,)."""
        quantum = self.levels[1] - self.levels[0]
        at = np.floor((command - self.levels[0]) / quantum + 0.5).astype(np.int64)
        return np.asarray(self.values[np.clip(at, 0, len(self.levels) - 1)])


def read_table(
    settings: SarsaSettings,
    tried: Int64[np.ndarray, "levels actions"],
    deviation: Float64[np.ndarray, "levels actions"],
    best: Int64[np.ndarray, " levels"],
) -> Table:
    """The table that the values say."""
    at = np.arange(settings.count)
    count = tried[at, best]
    learned = (best >= 0) & (count > 0)
    chosen = np.where(learned, best, at)
    mean = np.full(settings.count, np.nan)
    np.divide(deviation[at, chosen], tried[at, chosen], out=mean, where=tried[at, chosen] > 0)
    visits = tried.max(axis=1) if settings.mode == "full" else tried.sum(axis=1)
    if settings.mode == "replay":
        visits = visits // settings.passes
    actions = settings.actions
    return Table(settings.channel, actions, actions[chosen], visits, mean, learned)
