"""Values that come one by one → samples: those of one source time stamp belong together.

A server reports changes. A column that is not reported with a stamp did not change, so it has the
value that it had; where a sample is complete, or later ones came and its turn is over, it goes out.
Where reports may be gone (`doubt`), what is not reported is missing.

>>> groups = Groups(("x", "y"), together=1000)
>>> groups.put("x", 1.0, 5_000_000, 0.0); groups.put("y", 2.0, 5_000_400, 0.0)
>>> groups.put("x", 3.0, 9_000_000, 0.1)
>>> groups.take(0.1, settle=0.2), groups.take(0.4, settle=0.2)
([(5000000, {'x': 1.0, 'y': 2.0})], [(9000000, {'x': 3.0, 'y': 2.0})])
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from evertwin.sources.live.decode import Raw

FEW, PACED = 5, 50
"""Samples that tell how often they are made, and how often they come: in packets."""
TWICE = 2.0
"""Times the samples that so long a time has had: more than that a machine never makes."""
MOST = 4096
"""Samples that are put together at once."""


class Groups:
    """What is being put together. See the module for an example."""

    def __init__(self, names: tuple[str, ...], together: int) -> None:
        self.names = names
        self.together = together
        """Nanoseconds."""
        self._known: dict[str, Raw] = {}
        self.stamps: dict[str, int] = {}
        """Of the newest report of each column [ns]."""
        self.firm: set[str] = set(names)
        """Columns of which no report is gone."""
        self._open: dict[int, tuple[float, dict[str, Raw]]] = {}
        """Stamp → when its first value came, and its values."""

    def put(self, name: str, value: Raw, stamp: int, now: float) -> None:
        """A value with its source time stamp [ns]."""
        near = (s for s in reversed(self._open) if abs(s - stamp) <= self.together)
        _, values = self._open.setdefault(next(near, stamp), (now, {}))
        values[name] = value
        self.stamps[name] = max(stamp, self.stamps.get(name, stamp))

    def doubt(self, unchanged: Iterable[str] = ()) -> None:
        """Reports of columns may be gone, but of those that are ``unchanged`` since their last."""
        self.firm = set(unchanged)

    def believe(self) -> None:
        """From here on nothing is gone."""
        self.firm = set(self.names)

    def take(self, now: float, settle: float) -> list[tuple[int, dict[str, Raw]]]:
        """The samples that are ready, in order of their stamps.

        Args:
            now: monotonic [s].
            settle: how long one waits for what it lacks [s].
        """
        out: list[tuple[int, dict[str, Raw]]] = []
        for stamp in sorted(self._open):
            came, values = self._open[stamp]
            if len(values) < len(self.names) and now < came + settle and len(self._open) < MOST:
                break
            del self._open[stamp]
            self._known |= values
            held = {name: said for name, said in self._known.items() if name in self.firm}
            out.append((stamp, {**held, **values}))
        return out


class Passed:
    """How many samples lack between two by their stamps, and for how many there was time here.

    >>> passed = Passed()
    >>> [passed.since(k * 10, 0.01 * k) for k in (1, 2, 3, 9)], passed.room
    ([0, 0, 0, 5], 12)
    """

    def __init__(self) -> None:
        self._stamp = 0
        self._now = 0.0
        self._step = self._pace = math.inf
        """Nanoseconds between two stamps, seconds between two arrivals, mostly."""
        self._seen = self.room = 0

    @property
    def known(self) -> bool:
        """Is known how often they come?"""
        return self._seen > FEW

    def since(self, stamp: int, now: float) -> int:
        """What lacks before this one; ``now``: monotonic [s]."""
        step, passed = stamp - self._stamp, now - self._now
        first, self._stamp, self._now = self._seen == 0, max(stamp, self._stamp), now
        self._seen += 1
        if first or step <= 0:
            return 0
        if self._step == math.inf:
            self._step, self._pace = float(step), passed
            return 0
        lacks = round(step / self._step) - 1
        if lacks < 1:
            self._step += (step - self._step) / FEW
            self._pace += (passed - self._pace) / PACED
        self.room = math.ceil(TWICE * passed / self._pace) if self._pace > 0.0 else max(lacks, 0)
        return max(lacks, 0)
