"""The schedule: which parameters are tuned at which successive tuning.

A weight factor says how often a component is tuned: 1 at every tuning, 0.5 at every second one
(Aivaliotis, Arkouli, Georgoulias, Makris 2023: parameters with greater effect are tuned more
often). Turns are spread evenly and start with everything, so that the count of single-axis
simulations falls by one less the mean weight.

>>> schedule = Schedule({"Fc1": 1.0, "Fc2": 0.5, "Fc3": 0.25})
>>> [schedule.due(turn) for turn in range(4)]
[('Fc1', 'Fc2', 'Fc3'), ('Fc1',), ('Fc1', 'Fc2'), ('Fc1',)]
>>> schedule.count(20)
35
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from evertwin.errors import UsageError


@dataclass(frozen=True)
class Schedule:
    """Weights by name of parameter or axis. See the module for an example."""

    weights: Mapping[str, float]

    def __post_init__(self) -> None:
        for name, weight in self.weights.items():
            if not 0 < weight <= 1:
                raise UsageError(f"weight of {name}: expected above 0 and at most 1, got {weight}")

    def due(self, turn: int) -> tuple[str, ...]:
        """Names that are tuned at successive tuning ``turn`` (0, 1, …)."""
        return tuple(name for name, w in self.weights.items() if _is_due(w, turn))

    def count(self, turns: int) -> int:
        """Single-axis simulations over so many successive tunings."""
        return sum(len(self.due(turn)) for turn in range(turns))

    def saving(self, turns: int) -> float:
        """Share of the single-axis simulations that equal weights would take and this does not."""
        return 1.0 - self.count(turns) / (len(self.weights) * turns)


def _is_due(weight: float, turn: int) -> bool:
    """Evenly spread: where ⌈turn·weight⌉ steps up. The margin is for weights such as 1/3."""
    return math.ceil((turn + 1) * weight - 1e-9) > math.ceil(turn * weight - 1e-9)


def weights_from_growth(
    growth: Mapping[str, float], deviation: Mapping[str, float], limit: float = 0.05
) -> dict[str, float]:
    """The smallest weights that keep every axis inside ``limit``.

    Args:
        growth: how much each axis' relative deviation may grow from tuning to tuning.
        deviation: what is left right after a tuning.
        limit: the requirement.

    An axis that is at its limit at once gets 1.

    >>> weights_from_growth({"J1": 0.01, "J2": 0.002}, {"J1": 0.04, "J2": 0.03})
    {'J1': 1.0, 'J2': 0.1}
    """
    weights = {}
    for name, step in growth.items():
        turns = math.floor((limit - deviation[name]) / step + 1e-9) if step > 0 else 100
        weights[name] = 1.0 / min(max(turns, 1), 100)
    return weights
