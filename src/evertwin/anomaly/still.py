"""For how long has a measured input not changed at all?

One that never changes while the machine is driven on is a sensor that no longer answers. This stage
counts rows; whether the machine is driven is asked at the beat behind `least` rows, and again each
time that they have doubled.

>>> stage = Still(((0,),), least=3)
>>> u = np.array([[0.0], [1.0], [1.0], [1.0], [1.0]])
>>> state = stage.step(stage.init(1), 0, u)
>>> stage.known(state), stage.beat(state)[1]
(5, ((0, 3),))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evertwin.types import Float64, Inputs, Int64


class StillState(NamedTuple):
    """State of `Still`.

    >>> Still(((0, 1),), 3).init(2).rows.tolist()
    [0]
    """

    last: Float64[np.ndarray, " nu"]
    """The newest measured inputs."""
    rows: Int64[np.ndarray, " channels"]
    """Since the one in which each channel changed last."""
    said: Int64[np.ndarray, " channels"]
    """1: it is known not to answer; 2: so it is, and scatters; below 0: it answered again in row
    −1 − `said`, and rows that look back at those before are still to come."""
    asked: Int64[np.ndarray, " channels"]
    """Rows without a change at which it was to be asked about; 0: not since the newest beat."""
    news: Int64[np.ndarray, " one"]
    """Row after the first since the newest beat that has something for the next; 0: none."""


@dataclass(frozen=True)
class Still:
    """The stage. See the module for an example."""

    channels: tuple[tuple[int, ...], ...]
    """Columns of the inputs that come from each measured channel."""
    least: int
    """Rows without a change from which on it is asked."""

    def init(self, inputs: int) -> StillState:
        """Nothing seen of so many inputs."""
        none = np.zeros(len(self.channels), dtype=np.int64)
        news = np.zeros(1, dtype=np.int64)
        return StillState(np.full(inputs, np.nan), none, none.copy(), none.copy(), news)

    def step(self, state: StillState, row: int, u: Inputs) -> StillState:
        """Rows from ``row`` on. Consumes ``state``."""
        if not self.channels or not len(u):
            return state
        place, first = np.arange(len(u)), len(u)
        for k, columns in enumerate(self.channels):
            before, own = state.last[None, columns], u[:, columns]
            known = np.where(np.isfinite(own), place[:, None] + 1, 0)
            own = np.take_along_axis(
                np.concatenate([before, own]), np.maximum.accumulate(known, axis=0), axis=0
            )  # what is missing is what it was
            state.last[list(columns)] = own[-1]
            before = np.concatenate([before, own[:-1]])
            same = (own == before).all(axis=1)
            rows = place - np.maximum.accumulate(np.where(same, -1 - state.rows[k], place))
            asked = (rows >= self.least) & (rows % self.least == 0)
            asked &= np.bitwise_count(rows // self.least) == 1
            if state.said[k] == 1:  # until it changes
                again = len(u) if same.all() else int(np.argmin(same))
                asked[:again] = False
                state.said[k] = 1 if same.all() else -1 - (row + again)
            if asked.any():
                state.asked[k] = rows[np.flatnonzero(asked)[-1]]
                first = min(first, int(np.argmax(asked)))
            state.rows[k] = rows[-1]
        if first < len(u) and not state.news[0]:
            state.news[0] = row + first + 1
        return state

    def known(self, state: StillState) -> int:
        """Row after the first since the newest beat that has something for the next; 0: none."""
        return int(state.news[0])

    def beat(self, state: StillState) -> tuple[StillState, tuple[tuple[int, int], ...]]:
        """Channels that are to be asked about, and for how many rows they have not changed.
        Consumes ``state``."""
        asked = (state.asked > 0) & (state.rows >= state.asked)  # it may have moved since
        state.news[0], state.asked[:] = 0, 0
        return state, tuple((int(k), int(state.rows[k])) for k in np.flatnonzero(asked))
