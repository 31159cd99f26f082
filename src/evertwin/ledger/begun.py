"""A run that the log tells of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Begun:
    """A run that the log tells of.

    >>> Begun(1, 3, {"champion": 0}).over
    False
    """

    number: int
    position: int
    """Of its first entry in the log."""
    evidence: dict[str, Any]
    """What it began with: champion, versions, pinned, settings, tasks and time of runs before."""
    ended: dict[str, Any] | None = None
    """What it came to: tasks, their time, rows, their hash."""
    last: int = 0
    """Position of its end."""

    @property
    def pushed(self) -> bool:
        """Is it of samples that were pushed?"""
        return "first_chunk" in self.evidence

    @property
    def over(self) -> bool:
        """Has it ended, or been given up?"""
        return self.ended is not None
