"""What a detector is worth: found, delay, false alarms.

>>> at = np.array([5, 50, 51], dtype=np.int64) * 10**9
>>> score(at, onsets=np.array([49 * 10**9]), ends=np.array([60 * 10**9]),
...     calm=[(0, 40 * 10**9)])
Score(events=1, found=1, delays=(1.0,), false_alarms=1, calm_hours=0.0111...)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.types import Stamps

__all__ = ["Score", "score"]


class Score(NamedTuple):
    """Figures of one detector on labelled data.

    >>> Score(7, 7, (8.0,) * 7, 0, 3.4).found
    7
    """

    events: int
    found: int
    delays: tuple[float, ...]
    """From onset to alarm [s], of the events found."""
    false_alarms: int
    calm_hours: float

    @property
    def per_month(self) -> float:
        """False alarms per month of calm; NaN without calm data."""
        return self.false_alarms / self.calm_hours * 720.0 if self.calm_hours else float("nan")


def score(
    alarms: Stamps,
    onsets: np.ndarray,
    ends: np.ndarray,
    calm: Sequence[tuple[int, int]],
) -> Score:
    """Scores alarms.

    Args:
        alarms: stamps at which the detector fires [ns].
        onsets: where each event begins [ns], (m,).
        ends: until where an alarm counts for it [ns], (m,).
        calm: [start, stop) in which every alarm is false [ns].
    """
    delays = []
    for begin, end in zip(onsets.tolist(), ends.tolist(), strict=True):
        inside = alarms[(alarms >= begin) & (alarms < end)]
        if len(inside):
            delays.append((int(inside[0]) - begin) * 1e-9)
    wrong = sum(int(((alarms >= a) & (alarms < b)).sum()) for a, b in calm)
    hours = sum(b - a for a, b in calm) * 1e-9 / 3600.0
    return Score(len(onsets), len(delays), tuple(delays), wrong, hours)
