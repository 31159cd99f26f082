"""What a sensor said of late: a ring of fixed capacity, and its value between two words.

>>> heard = Words.none(1)
>>> for t in (0, 10, 20, 500):
...     heard = heard.said(t, np.array([0.1 * t]))
>>> heard.at(15, silent=100), heard.at(100, silent=100), heard.newest
(array([1.5]), None, 500)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.types import Float64, Int64, Vector

CAPACITY = 512
"""Words that are kept."""
NEVER = -(2**62)
"""Stamp before all others [ns]."""


class Words(NamedTuple):
    """The newest words, numbered modulo the capacity. See the module for an example."""

    t: Int64[np.ndarray, " words"]
    """[ns]"""
    v: Float64[np.ndarray, "words k"]
    spoken: int
    """How many there were."""

    @classmethod
    def none(cls, k: int) -> Words:
        """Nothing was said yet; ``k`` numbers a word."""
        return cls(np.zeros(CAPACITY, np.int64), np.zeros((CAPACITY, k)), 0)

    @property
    def newest(self) -> int:
        """Stamp of the newest one [ns]."""
        return int(self.t[(self.spoken - 1) % CAPACITY]) if self.spoken else NEVER

    def said(self, t: int, v: Vector) -> Words:
        """With a word more, newer than the others. Consumes ``self``."""
        self.t[self.spoken % CAPACITY], self.v[self.spoken % CAPACITY] = t, v
        return self._replace(spoken=self.spoken + 1)

    def at(self, t: int, silent: int) -> Vector | None:
        """In proportion between the words around ``t``; None: there are none, or they are further
        apart than ``silent`` [ns]."""
        k = self.spoken - 1
        oldest = max(self.spoken - CAPACITY, 0)
        while k >= oldest and self.t[k % CAPACITY] > t:
            k -= 1
        if k < oldest:
            return None
        before, v = int(self.t[k % CAPACITY]), self.v[k % CAPACITY]
        if before == t:
            return np.asarray(v.copy())
        if k + 1 == self.spoken:
            return None
        after = int(self.t[(k + 1) % CAPACITY])
        if after - before > silent:
            return None
        share = (t - before) / (after - before)
        return np.asarray(v + share * (self.v[(k + 1) % CAPACITY] - v))
