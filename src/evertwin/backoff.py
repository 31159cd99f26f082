"""Waits between attempts to reach somebody who is not there.

They grow, with full jitter, so that a hundred twins do not come back at the same moment.
"""

from __future__ import annotations

import random

SHORTEST = 0.2
LONGEST = 30.0
"""Seconds between two attempts, at first and at most."""


class Backoff:
    """Waits between attempts: any time up to a bound that doubles.

    >>> wait = Backoff(0.1, 0.4)
    >>> [wait.next() <= bound for bound in (0.1, 0.2, 0.4, 0.4)]
    [True, True, True, True]
    """

    def __init__(self, shortest: float = SHORTEST, longest: float = LONGEST) -> None:
        self.shortest = shortest
        self.longest = longest
        self._bound = shortest

    def next(self) -> float:
        """Seconds to wait now."""
        bound, self._bound = self._bound, min(2 * self._bound, self.longest)
        return random.uniform(0.1 * bound, bound)

    def reset(self) -> None:
        """The line was up."""
        self._bound = self.shortest
