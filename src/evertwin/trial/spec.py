"""Settings of the gate to the live model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt

from evertwin.fold.span import Span
from evertwin.settings.kinds import Duration
from evertwin.settings.notes import Rows
from evertwin.settings.section import Section

MANY = 2
"""So many times the fewest segments are enough, however short they are."""


@dataclass(frozen=True)
class TrialSpec(Section):
    """``[trial]``: the gate to the live model. One set of settings serves all machines.

    >>> TrialSpec().alpha
    0.01
    """

    alpha: Annotated[float, Gt(0.0), Lt(0.5)] = 0.01
    """Chance of promoting a challenger that is no better."""
    margin: Annotated[float, Ge(0.0), Lt(1.0)] = 0.05
    """Smallest relative gain on unseen data."""
    segments: Annotated[int, Ge(2), Le(1_000_000)] = 20
    """Fewest segments."""
    duration: Duration = 30.0
    """Time that they cover at least; of a fast machine twice ``segments`` are enough."""
    limit: Annotated[int, Ge(2), Le(1_000_000)] = 2000
    """Segments after which a trial ends without promotion."""
    probation: Annotated[int, Ge(10), Le(1_000_000)] = 150
    """Segments after a promotion during which the old champion runs along."""
    holdoff: Annotated[Span, Rows(least=0)] = Span(100)
    """Rows, or time, after a rejection or roll-back before the next candidate."""

    def lasts(self, horizon: float) -> float:
        """Time that segments of this horizon have to cover [s].

        >>> TrialSpec().lasts(1.0), TrialSpec().lasts(0.05)
        (30.0, 2.0)
        """
        return min(self.duration, MANY * self.segments * horizon)
