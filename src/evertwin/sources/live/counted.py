"""How many samples a machine made between two that were read, where it counts them.

A column that changes with each sample may be a count or a time: it is a count where whole numbers
follow each other, one by one, often enough. What it says of gaps before that is known is said then.

>>> counted = Counted()
>>> [counted.missing(number) for number in (7, 8, 9, 14, 15, 2, 3)]
[0, 0, 0, 4, 0, 0, 0]
>>> clock = Counted()
>>> [clock.missing(number) for number in (1000, 1050, 1100, 1151)]
[0, 0, 0, 0]
"""

from __future__ import annotations

from evertwin.sources.live.decode import Raw

FAR = 2.0**53
ENOUGH = 2
"""Steps of one, without which nobody knows that it counts."""


class Counted:
    """The count along one source. See the module for an example."""

    def __init__(self) -> None:
        self._newest: float | None = None
        self._ones = 0
        self._waits = 0
        """Missing, if it counts."""

    def missing(self, number: Raw) -> int:
        """Samples between this one and the newest before it; none where the count began anew."""
        if isinstance(number, bool) or not isinstance(number, int | float):
            return 0
        before, self._newest = self._newest, float(number)
        if before is None or not 0 < number - before < FAR or number % 1 or before % 1:
            return 0
        self._ones += number - before == 1
        self._waits += int(number - before) - 1
        if self._ones < ENOUGH:
            return 0
        found, self._waits = self._waits, 0
        return found
