"""Recovery: an earlier version is weighed for good, for what wears may be repaired.

The first champion predicts every segment that the live version predicts. While the live one does
better there is nothing to weigh, so the bets begin anew wherever its deviation is the smaller since
they began: what is bet on are the rows since the machine went back, and not how well the live
version did while it was worn. It is no trial of something new: the version has been live.

>>> noise = np.random.default_rng(1).uniform(0.8, 1.2, (100, 2)) ** 2
>>> rows = 10.0 * np.arange(100)[:, None]
>>> losses = np.hstack([noise * np.where(rows < 800, (1.0, 9.0), (9.0, 1.0)), rows])
>>> recovery = Recovery()
>>> state = recovery.init()
>>> recovery.step(state, losses[:80]), recovery.step(state, losses[80:]) >= 0
(-1, True)
>>> found = recovery.verdict(state)[1]
>>> found["since"], found["segments"] <= 20
(800, True)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evertwin.trial.betting import GRID, LENGTHS
from evertwin.trial.gate import GateState, figures, new_state
from evertwin.trial.gate_loop import OTHER, since_better
from evertwin.trial.odds import ODDS, odds
from evertwin.types import Float64, Vector


@dataclass(frozen=True)
class Recovery:
    """Settings. Its losses are (live version, earlier version).

    >>> Recovery().margin
    0.5
    """

    alpha: float = 0.01
    """Chance that bets which once began end in a version that is not better."""
    proven: float = 0.25
    """Gain that the sequential test has to prove."""
    margin: float = 0.5
    """Gain in deviation since the bets began from which on the machine is as it was."""
    segments: int = 10
    """Segments at least."""
    before: int = 5
    """Segments at least on which the live version did better: else it was wrong from the first."""
    worse: float = 0.3
    """Gain from which on the live version, off by more than is asked, is the worse of the two."""
    sure: float = 3.0
    """Sum of the differences of both, by the root of the sum of their squares, of as many segments
    at least: no few of them decide."""

    @cached_property
    def rule(self) -> Vector:
        """The settings as the loop reads them; the bets have no limit."""
        bar = -math.log(self.alpha)
        return np.array([self.proven, bar, math.inf, self.margin, self.segments, self.before])

    def init(self) -> GateState:
        """The state before the first segment: beside its bets how often they began anew, the last
        row of their first segment, and the sum of the squared differences since."""
        return new_state(2)

    def step(self, state: GateState, losses: Float64[np.ndarray, "m three"]) -> int:
        """Folds segments (both losses, last row) into ``state``, in place.

        Returns:
            Index of the one that decides that the earlier version fits again; −1: none does.
        """
        return int(since_better(losses, self.rule, LENGTHS, GRID, state))

    def outdone(self, state: GateState) -> bool:
        """Is the earlier version the better one of two of which neither need fit?

        >>> recovery, often = Recovery(), np.random.default_rng(0).uniform(0.5, 1.5, (60, 2))
        >>> live, other, rows = 2.0 * often[:, 0], often[:, 1], np.arange(60.0)
        >>> state = recovery.init()
        >>> _ = recovery.step(state, np.stack([live**2, other**2, rows], axis=1))
        >>> recovery.outdone(state), recovery.outdone(recovery.init())
        (True, False)
        """
        live, other = float(state.sums[0]), float(state.sums[1])
        squares = state.harm[2:]  # a checkpoint that is older knows none
        sure = len(squares) and live - other >= self.sure * math.sqrt(float(squares[0]))
        return bool(state.tally[1] >= self.segments and other <= (1.0 - self.worse) * live and sure)

    def verdict(self, state: GateState) -> tuple[bool, dict[str, Any]]:
        """Does the earlier version fit again, and the evidence as plain scalars."""
        found = figures(state) | {"since": int(state.harm[1])}
        found["sentence"] = (
            f"{100 * found['gain']:.1f} % less deviation over the newest {found['segments']} "
            f"segments{ODDS}{odds(found['e_value'])} that it is no chance"
        )
        return int(state.tally[0]) == OTHER, found
