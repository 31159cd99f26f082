"""Probation: a promoted version keeps being compared with the champion that it replaced.

The same bets as in the trial, on fresh segments. If they say that the replaced champion is better,
the new one is rolled back; if they say that the new one is better, or nothing for the length of the
probation, it stays.

>>> noise = np.random.default_rng(1).normal(size=80) ** 2
>>> promoted, replaced = 4.0 * noise, noise
>>> probation = Probation()
>>> probation.step(probation.init(), np.stack([promoted, replaced], axis=1))[1]
'roll_back'
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from evertwin.errors import UsageError
from evertwin.trial.gate import GateState, figures, new_state, pass_through
from evertwin.trial.gate_loop import OPEN, OTHER, STAYS
from evertwin.trial.odds import ODDS, odds
from evertwin.types import Float64, Vector

_KINDS: dict[int, Literal["keep", "roll_back"] | None] = {
    OPEN: None, OTHER: "roll_back", STAYS: "keep"
}  # fmt: skip


@dataclass(frozen=True)
class Probation:
    """Settings of a probation. Its losses are (live version, replaced version).

    >>> Probation().alpha
    0.05
    """

    alpha: float = 0.05
    """Chance that a version as good as the replaced one is rolled back."""
    segments: int = 10
    """Segments at least, before it is rolled back or kept early."""
    limit: int = 150
    """Segments after which it stays unless it was rolled back."""
    measures: int = 0
    """Safety measures per segment."""

    def __post_init__(self) -> None:
        if not 0 < self.alpha < 1:
            raise UsageError(f"alpha: expected within (0, 1), got {self.alpha}")
        if not 0 < self.segments <= self.limit:
            raise UsageError(
                f"probation: expected 0 < segments <= limit, got {self.segments} and {self.limit}"
            )

    @cached_property
    def rule(self) -> Vector:
        """The settings as the loop reads them: no margin, no least gain."""
        bar = -math.log(self.alpha)
        return np.array([0.0, bar, bar, 0.0, self.segments, self.limit])

    def init(self) -> GateState:
        """The state before the first segment."""
        return new_state(self.measures)

    def step(
        self, state: GateState, losses: Float64[np.ndarray, "m columns"]
    ) -> tuple[GateState, Literal["keep", "roll_back"] | None]:
        """The state after more segments, and the verdict once there is one.

        Consumes ``state``; ``losses`` as in `evertwin.trial.Trial.step`, with the replaced version
        in the place of the challenger.

        Raises:
            UsageError: another number of columns.
        """
        pass_through(state, losses, self.rule)
        return state, _KINDS[int(state.tally[0])]

    def verdict(
        self, state: GateState
    ) -> tuple[Literal["keep", "roll_back"] | None, dict[str, Any]]:
        """The verdict (None: undecided) and the evidence as plain scalars, with a sentence."""
        found = figures(state)
        found["sentence"] = (
            f"the replaced version's deviation is {-100 * found['gain']:+.1f} % of the live one's "
            f"over {found['segments']} segments{ODDS}{odds(found['e_value'])} for the replaced "
            f"and {odds(found['e_value_against'])} for the live version"
        )
        return _KINDS[int(state.tally[0])], found
