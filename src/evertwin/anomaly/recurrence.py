"""Does what seems to act from outside come again at the same place? Then it is the machine's own.

A worn or dirty place, a friction that grew with speed, work that is done there: each comes where
one input of the model is what it was the last times. Of the newest contacts, as many as lie closest
together in one input are compared with how often the machine is there at all: were contacts to come
at any time, the chance of so many so close would be below `CHANCE`.

>>> stage, rng = Recurrence(inputs=2), np.random.default_rng(0)
>>> rows = rng.uniform(-1.0, 1.0, (1000, 2))
>>> state = stage.init()
>>> for x in (0.30, 0.33, 0.28, 0.31, 0.30):
...     state = stage.met(state, np.array([rng.uniform(-1, 1), x]))
>>> state, place = stage.found(state, rows)
>>> place.column, place.times, bool(place.low < 0.3 < place.high)
(1, 5, True)
>>> stage.inside(state, np.array([[0.0, 0.3], [0.3, 0.0]])).tolist()
[True, False]
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evertwin.types import Bools, Float64, Inputs, Vector

KEPT, FEWEST, PLACES = 8, 4, 4
"""Contacts that are remembered, those that make a place, and places."""
CHANCE = 0.01
"""Chance of a place that is none."""
WIDER = 0.5
"""What a place reaches beyond the contacts that told of it, as a share of their distance."""


class RecurrenceState(NamedTuple):
    """State of `Recurrence`.

    >>> Recurrence(inputs=3).init().met.shape
    (8, 3)
    """

    met: Float64[np.ndarray, "kept nu"]
    """Inputs in the middle of each contact, newest first; NaN: there were no more."""
    places: Float64[np.ndarray, "places three"]
    """Column, low and high of each place, newest first; NaN: there are no more."""


class Place(NamedTuple):
    """Where contacts come again.

    >>> Place(0, 0.1, 0.2, 5).times
    5
    """

    column: int
    """Of the inputs."""
    low: float
    high: float
    times: int


@dataclass(frozen=True)
class Recurrence:
    """The stage. See the module for an example."""

    inputs: int

    def init(self) -> RecurrenceState:
        """Nothing met."""
        return RecurrenceState(np.full((KEPT, self.inputs), np.nan), np.full((PLACES, 3), np.nan))

    def met(self, state: RecurrenceState, u: Vector) -> RecurrenceState:
        """One more contact, with the inputs in its middle."""
        return state._replace(met=np.concatenate([u[None], state.met[:-1]]))

    def found(
        self, state: RecurrenceState, rows: Inputs, noise: Vector | None = None
    ) -> tuple[RecurrenceState, Place | None]:
        """A place at which contacts come again; those that told of it are forgotten.

        Args:
            state: of the contacts.
            rows: inputs while the machine moved, (n, nu).
            noise: what each input scatters by, (nu,): no place is narrower.
        """
        finest = np.zeros(self.inputs) if noise is None else noise
        known = np.isfinite(state.met).all(axis=1)
        met = state.met[known]
        best, least = None, CHANCE
        for column in range(self.inputs if len(rows) else 0):
            values = np.sort(met[:, column])
            for times in range(FEWEST, len(met) + 1):
                spans = values[times - 1 :] - values[: len(values) - times + 1]
                first = int(np.argmin(spans))
                low = float(values[first] - finest[column])
                high = float(values[first + times - 1] + finest[column])
                there = float(np.mean((rows[:, column] >= low) & (rows[:, column] <= high)))
                there = max(there, 1.0 / len(rows))
                ways = math.comb(len(met), times) * times * self.inputs
                chance = ways * there ** (times - 1)
                if chance < least:
                    best, least = Place(column, low, high, times), chance
        if best is None:
            return state, None
        more = WIDER * (best.high - best.low)
        place = np.array([best.column, best.low - more, best.high + more])
        places = np.concatenate([place[None], state.places[:-1]])
        values = state.met[:, best.column]
        left = np.full_like(state.met, np.nan)
        rest = state.met[known & ((values < best.low) | (values > best.high))]
        left[: len(rest)] = rest
        return RecurrenceState(left, places), best

    @staticmethod
    def noise(rows: Inputs) -> Vector:
        """What inputs scatter by from row to row, (nu,), beside what goes on; rows in order.

        >>> scatter = np.random.default_rng(0).normal(0.0, 0.1, 500)
        >>> way = np.arange(500.0)
        >>> Recurrence.noise(np.stack([way, way + scatter], axis=1)).round(2).tolist()
        [0.0, 0.1]
        """
        bends = np.diff(rows, 2, axis=0)
        if not np.isfinite(bends).all(axis=1).any():
            return np.zeros(rows.shape[1])
        return np.asarray(np.nanmedian(np.abs(bends), axis=0) / (0.6745 * math.sqrt(6.0)))

    def inside(self, state: RecurrenceState, u: Inputs) -> Bools:
        """Which rows are at a place, (n,)."""
        there = np.zeros(len(u), dtype=np.bool_)
        for column, low, high in state.places[np.isfinite(state.places[:, 0])]:
            there |= (u[:, int(column)] >= low) & (u[:, int(column)] <= high)
        return there
