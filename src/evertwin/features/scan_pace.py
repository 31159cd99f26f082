"""How evenly scans come, and how many did not come before one.

>>> pace = ScanPace()
>>> for _ in range(20):
...     pace, missed = pace.after(0.5)
>>> pace.after(6.5)[1]
12
"""

from __future__ import annotations

from typing import NamedTuple

HOLE = 4.0
"""So many usual times without a scan are a hole."""
EVEN = 0.3
"""Share by which times may differ where they tell how many scans are missing: of a log that was
thinned to a scan a metre they tell nothing."""
MOST = 40
"""Scans that a hole is taken for at most."""
LEARNS = 0.1
"""How much one time tells of what is usual."""


class ScanPace(NamedTuple):
    """Times between scans of late. See the module for an example."""

    usual: float = 0.0
    """[s]"""
    uneven: float = 1.0
    """By which share of it one differs."""

    def after(self, dt: float) -> tuple[ScanPace, int]:
        """With one time more [s], and how many scans are missing in it."""
        usual = self.usual or dt
        short = min(dt, HOLE * usual)
        off = min(abs(short - usual) / max(usual, 1e-9), 1.0)
        hole = dt > HOLE * usual > 0.0 and self.uneven < EVEN
        pace = ScanPace(
            usual + LEARNS * (short - usual), self.uneven + LEARNS * (off - self.uneven)
        )
        return pace, min(round(dt / usual) - 1, MOST) if hole else 0
