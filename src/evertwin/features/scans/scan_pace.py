"""How evenly scans come, and how many are missing since there was a pose.

>>> pace = ScanPace()
>>> for _ in range(20):
...     pace = pace.after(0.5, steps=0.1)
>>> pace.after(6.5, steps=0.1).missed
12
"""

from __future__ import annotations

from typing import NamedTuple

HOLE = 4.0
"""So many usual times without a scan are a hole."""
EVEN, SHORT = 0.2, 0.5
"""Share by which times may differ, and how long steps may be [m], where time tells how many scans
are missing: of a log that was thinned to a scan a metre it tells nothing."""
LEARNS = 0.1
"""How much one time tells of what is usual."""


class ScanPace(NamedTuple):
    """Times between scans of late. See the module for an example."""

    usual: float = 0.0
    """[s]"""
    uneven: float = 1.0
    """By which share of it one differs."""
    missed: int = 0
    """Scans that did not come since there was a pose."""

    def after(self, dt: float, steps: float) -> ScanPace:
        """With one time more [s]. ``steps``: as long as they are at most [m]; infinite: something
        else tells how far it went."""
        usual = self.usual or dt
        short = min(dt, HOLE * usual)
        off = min(abs(short - usual) / max(usual, 1e-9), 1.0)
        hole = dt > HOLE * usual > 0.0 and self.uneven < EVEN
        missed = self.missed + (round(dt / usual) - 1 if hole else 0)
        return ScanPace(
            usual + LEARNS * (short - usual), self.uneven + LEARNS * (off - self.uneven),
            missed if steps < SHORT else 0,
        )  # fmt: skip

    @property
    def found(self) -> ScanPace:
        """There is a pose."""
        return self._replace(missed=0)
