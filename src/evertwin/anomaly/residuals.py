"""What every detector sees: residuals row by row, each with its stamp and its phase.

>>> rows = Residuals.of(np.array([[0.1], [0.2]]), interval=3.0)
>>> rows.t.tolist(), rows.phase.tolist()
([0, 3000000000], [0, 0])
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.types import Outputs, Stamps, Tasks


class Residuals(NamedTuple):
    """Consecutive rows; NaN where nothing was measured, trusted or predicted.

    >>> Residuals._fields
    ('row', 't', 'r', 'phase')
    """

    row: Tasks
    """Row numbers, (n,)."""
    t: Stamps
    """Stamps [ns], (n,)."""
    r: Outputs
    """Measured − predicted, (n, ny)."""
    phase: Tasks
    """Phase of each row, (n,); −1: unknown."""

    @classmethod
    def of(cls, r: np.ndarray, interval: float, phase: np.ndarray | None = None) -> Residuals:
        """Residuals (n, ny) at a fixed ``interval`` [s], from row 0 on."""
        n = len(r)
        row = np.arange(n, dtype=np.int64)
        steps = np.full(n, 0, dtype=np.int64) if phase is None else phase.astype(np.int64)
        return cls(row, row * round(interval * 1e9), np.asarray(r, dtype=np.float64), steps)

    def take(self, start: int, stop: int) -> Residuals:
        """Rows ``start`` to ``stop`` (positions), as views."""
        return Residuals(*(a[start:stop] for a in self))


class Alarms(NamedTuple):
    """What a detector says of each row.

    >>> Alarms._fields
    ('row', 'alarm', 'statistic')
    """

    row: Tasks
    alarm: np.ndarray
    """int8, (n, ny): 1 upwards, −1 downwards, 0 none."""
    statistic: Outputs
    """The detector's statistic over its limit, (n, ny); NaN while it is not calibrated."""
