"""How a robot without odometry moves, as its last steps show: what it may do next.

Robots go on as before, stop, start, or do what they did a while ago; logs thinned to a scan a metre
have no time that would tell a speed. So the next step is expected near each of the last ones, the
newest counting most, and near none at all: a kernel density with Student's kernels.

>>> walks = Habits.none()
>>> for _ in range(9):
...     walks = walks.learnt(np.array([0.5, 0.0, 0.0]))
>>> steps, weights = walks.known()
>>> steps[weights.argmax()].tolist(), round(walks.reach[0], 2), walks.spread < 0.2
([0.5, 0.0, 0.0], 0.5, True)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from evertwin.types import Float64, Vector

MOST = 40
"""Steps that are remembered."""
RECENT = 15.0
"""So many steps ago one counts a third."""
FIRST, FREE, LEAST, PART = 1.0, 0.3, 0.05, 0.14
"""How far a step may be off all others: before any is known, and then at most [m]; where they
hardly differ, at least so far [m], and so large a part of a usual one."""
MIRRORED = 0.5
"""How much a step to the other side counts."""
LEARNS, FORGETS = 0.1, 0.9
"""How much one step tells of how far they differ, and how much of the longest is kept."""


class Habits(NamedTuple):
    """The last steps. See the module for an example."""

    steps: Float64[np.ndarray, "habits 3"]
    """In a ring, each in the frame of its start (m, m, rad)."""
    made: int
    """How many there were."""
    varies: float
    """Square of how far a step is off the nearest of those before, on average [m²]."""
    reach: tuple[float, float]
    """The longest one of late [m], and the largest turn [rad]."""

    @classmethod
    def none(cls) -> Habits:
        """Of a robot that has not moved yet."""
        return cls(np.zeros((MOST, 3)), 0, FREE * FREE, (0.0, 0.0))

    def known(self) -> tuple[Float64[np.ndarray, "k 3"], Vector]:
        """The steps, newest first, then none at all, then mirrored ones; and weights (sum 1)."""
        n = min(self.made, MOST)
        newest = self.steps[(self.made - 1 - np.arange(n)) % MOST]
        weights = np.exp(-np.arange(n + 1) / RECENT)
        both = np.concatenate([newest, np.zeros((1, 3)), newest * [1.0, -1.0, -1.0]])
        weights = np.concatenate([weights, MIRRORED * weights[:n]])
        return both, weights / weights.sum()

    @property
    def spread(self) -> float:
        """How far the next step may be off the nearest of those before [m]."""
        if not self.made:
            return FIRST
        steps = self.steps[: self.made, :2]
        usual = math.sqrt(float(np.sum(steps * steps)) / max(len(steps), 1))
        return min(max(math.sqrt(self.varies), LEAST, PART * usual), FREE)

    def learnt(self, step: Float64[np.ndarray, " 3"]) -> Habits:
        """With one more."""
        off = float(np.sum((self.known()[0] - step)[:, :2] ** 2, axis=1).min())
        steps = self.steps.copy()
        steps[self.made % MOST] = step
        return Habits(
            steps, self.made + 1, self.varies + LEARNS * (min(off, FREE * FREE) - self.varies),
            (max(math.hypot(step[0], step[1]), FORGETS * self.reach[0]),
             max(abs(float(step[2])), FORGETS * self.reach[1])),
        )  # fmt: skip
