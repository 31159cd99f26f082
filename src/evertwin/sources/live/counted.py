"""How many samples a machine made between two that were read, where it counts them.

A column that changes with each sample may be a count or a time: it is a count where whole numbers
follow each other, one by one, often enough: from sample to sample or, of a machine that goes on
faster than it is read, in quick readings of the number alone. What it says of gaps before that is
known is said then.

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
        self._read = self._ticks = self._leaps = 0
        """Quick readings, and between how many it went on by one, or by more."""

    def within(self, before: Raw, after: Raw) -> None:
        """The number in two quick readings. A clock that runs free moves in most.

        >>> counted = Counted()
        >>> for number in (4, 7, 12, 16):
        ...     counted.within(number, number + (number > 10))
        >>> [counted.missing(number) for number in (4, 7, 13, 17)]
        [0, 2, 5, 3]
        """
        if isinstance(before, int | float) and isinstance(after, int | float):
            self._read += 1
            self._ticks += after - before == 1
            self._leaps += after - before > 1

    @property
    def known(self) -> bool:
        """Does it count?"""
        moved = self._ticks + self._leaps
        ticks = self._ticks >= ENOUGH and self._ticks > self._leaps and 2 * moved <= self._read
        return self._ones >= ENOUGH or ticks

    def missing(self, number: Raw) -> int:
        """Samples between this one and the newest before it; none where the count began anew."""
        if isinstance(number, bool) or not isinstance(number, int | float):
            return 0
        before, self._newest = self._newest, float(number)
        if before is None or not 0 < number - before < FAR or number % 1 or before % 1:
            return 0
        self._ones += number - before == 1
        self._waits += int(number - before) - 1
        if not self.known:
            return 0
        found, self._waits = self._waits, 0
        return found
