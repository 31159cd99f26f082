"""What comes of scans: poses and tables at their stamps, and what is to be said.

>>> out = Said()
>>> out.tell(5, "pose_lost", "scan", "3 scans in a row tell no pose", first=3)
>>> out.out.records[0].evidence
{'first': 3}
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from evertwin.fold import Event, Out
from evertwin.types import Float64, Int64, Stamps, Vector


class Placed(NamedTuple):
    """Poses at the stamps of scans.

    >>> Placed._fields
    ('t', 'pose', 'segment', 'task', 'tables')
    """

    t: Stamps
    pose: Float64[np.ndarray, "n 3"]
    """x, y [m], heading [rad, not wrapped]; NaN where the scan tells none."""
    segment: Int64[np.ndarray, " n"]
    """Of the map that it is told in: a new one begins somewhere unknown."""
    task: Int64[np.ndarray, " n"]
    tables: Float64[np.ndarray, "n _"]
    """What each place for one holds, in turn (`evertwin.models.tables.bodies`)."""


class Said:
    """What came out of one step."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, Vector, int, int, Vector]] = []
        self.events: list[Event] = []

    def tell(self, t: int, kind: str, signal: str, reason: str, **evidence: Any) -> None:
        """Something to be said; who knows the row puts it in."""
        self.events.append(Event(0, t, kind, signal, reason, evidence))

    @property
    def out(self) -> Out:
        """All of it."""
        if not self.rows:
            return Out(None, tuple(self.events))
        columns = zip(*self.rows, strict=True)
        return Out(Placed(*map(np.array, columns)), tuple(self.events))
