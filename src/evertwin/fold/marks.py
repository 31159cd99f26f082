"""Marks: how far a sample can be trusted, one small integer per signal and row.

Worst wins: when several stages judge one sample, the larger number stays.

>>> from evertwin.fold.marks import Mark
>>> max(Mark.HELD, Mark.ERROR).name
'ERROR'
"""

from __future__ import annotations

from enum import IntEnum


class Mark(IntEnum):
    """Quality of one sample, from trusted to refused.

    >>> [mark.name.lower() for mark in Mark][3:]
    ['late', 'contested', 'overruled', 'error', 'external']
    """

    OK = 0
    """Measured and trusted."""
    ABSENT = 1
    """Nothing was measured at this row; the value is NaN."""
    HELD = 2
    """The last value was kept (inputs between two commands)."""
    LATE = 3
    """Measured, but after its row had left; recorded, not folded."""
    CONTESTED = 4
    """Outside the innovation gate while the vote is open."""
    OVERRULED = 5
    """The vote passed: this measurement overrules the simulation."""
    ERROR = 6
    """Obvious measurement error: the simulation is trusted."""
    EXTERNAL = 7
    """Something outside acts on the machine: measured, and nothing that its model can know."""
