"""The clock of a live source: nothing twice, and no stamp can stop a twin.

A stamp that came before is repeated. One far ahead of what the time of arrival allows, or far
behind the newest, is held: if the samples after it return to the old clock it was one bad stamp; if
`CONFIRM` samples go on from it the machine's clock was set, and from there on stamps are moved to
go on where the old clock was, because intervals stay true when a clock does not. A stamp a little
behind is late: it goes out, for the twin has slack for it, or leaves it out and says so. Samples
that were kept somewhere and come at once are old, never ahead.

>>> clock, s = Stamping(), 10**9
>>> arrivals = {1: 101, 2: 102, 4000: 103, 3: 104}
>>> [o for t in (1, 2, 2, 4000, 3) for o, _ in clock.take(t * s, arrivals[t] * s, None)]
[1000000000, 2000000000, 3000000000]
>>> clock.repeated, clock.rejected
(1, 1)
"""

from __future__ import annotations

import time
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")
FAR = 10 * 10**9
"""A step [ns] from which on a stamp needs others that agree with it."""
AGAIN = 10**9
"""Time [ns] in which what a broker sends again after a start has come: old, and all at once."""
HURRIED = 1.5
"""Seconds of stamps in a second, from which on arrival says nothing of what is ahead."""
GAP = 10**9
"""Interval [ns] that a moved clock leaves where nobody knows how long it was."""
STEPS = 100
"""Steps of a source that make one far, where arrival says nothing."""
CONFIRM = 3
"""Samples that must follow a held one on its own clock before it is believed."""
KNOWN = 4096
"""Stamps that are remembered, to know again what comes late and twice."""
_DAY = 86_400 * 10**9
_MONTH = 31 * _DAY
_ANCHOR = time.time_ns() - time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def arrival() -> int:
    """Now [ns, Unix], on a clock that nobody sets while this process runs.

    >>> arrival() < arrival()
    True
    """
    return _ANCHOR + time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class Stamping(Generic[T]):
    """The state along one source; `take` every sample. See the module for an example."""

    def __init__(self, *, arrives: bool = True) -> None:
        self.arrives = arrives
        """Do times of arrival mean anything? Not for files that are read as fast as they can."""
        self.newest: int | None = None
        self.judged: int | None = None
        """Stamp of the last sample, on the clock that goes out."""
        self.repeated = 0
        self.rejected = 0
        """Single stamps of no clock."""
        self.set = 0
        """How often the machine's clock was set."""
        self._resumed: int | None = None
        self._shift = 0
        self._lead: int | None = None
        """Smallest delay between stamp and arrival so far [ns]."""
        self._step = 0.0
        """What lies between two stamps, mostly [ns]."""
        self._first: tuple[int, int] | None = None
        """First stamp, and its arrival."""
        self._held: list[tuple[int, int, T]] = []
        self._order: deque[int] = deque()
        self._known: set[int] = set()

    @property
    def holds(self) -> bool:
        """Do samples wait for others that agree with them?"""
        return bool(self._held)

    def resume(self, stamp: int) -> None:
        """Go on after the newest stamp that is stored."""
        self.newest = self._resumed = stamp

    def take(self, stamp: int, came: int, sample: T) -> list[tuple[int, T]]:
        """The samples that go out now, each with its stamp [ns].

        Args:
            stamp: of the sample [ns].
            came: its `arrival` [ns].
            sample: what is kept with it.
        """
        moved = self.judged = stamp + self._shift
        stored = not self.arrives and self._resumed is not None and moved <= self._resumed
        again = bool(self._held) and stamp == self._held[-1][0]
        if stored or again or moved in self._known:
            self.repeated += 1
            return []
        if self._follows(moved, came):
            self._drop()
            return self._out(moved, came, sample)
        if self._held and not self._joins(stamp):
            self._drop()
        self._held.append((stamp, came, sample))
        if len(self._held) <= CONFIRM or self._may_be_stored(came):
            return []
        return self._believed()

    def _may_be_stored(self, came: int) -> bool:
        """Are those that are held what was stored, not acknowledged, and sent again at a start?"""
        resumed, (oldest, began, _) = self._resumed, self._held[0]
        fresh = resumed is not None and self._first is None and came - began < AGAIN
        return fresh and resumed is not None and oldest <= resumed

    def _drop(self) -> None:
        again = bool(self._held) and self._may_be_stored(self._held[-1][1])
        self.repeated += len(self._held) if again else 0
        self.rejected += 0 if again else len(self._held)
        self._held = []

    def _follows(self, stamp: int, came: int) -> bool:
        """Is it on the clock that holds so far?"""
        if self.newest is None:
            return not self.arrives or stamp <= came + _DAY
        if stamp < self.newest - FAR:
            return False
        if not self.arrives or self._hurried(came):
            return stamp <= self.newest + max(FAR, min(int(STEPS * self._step), _MONTH))
        # the first one after a start: the machine may have stood for any time
        ahead = came - stamp < self._lead - FAR if self._lead is not None else stamp > came + _DAY
        return not ahead or stamp <= self.newest + FAR

    def _joins(self, stamp: int) -> bool:
        """Does it go on from what is held?"""
        held = [t for t, _, _ in self._held]
        most = max(FAR, STEPS * (held[1] - held[0])) if len(held) > 1 else _MONTH
        return 0 < stamp - held[-1] <= most

    def _hurried(self, came: int) -> bool:
        """Do stamps go faster than the clock here: a machine in time-lapse, or what was kept?"""
        if self._first is None or self.newest is None:
            return False
        stamp, began = self._first
        return self.newest - stamp > HURRIED * (came - began) + FAR // 10

    def _out(self, stamp: int, came: int, sample: T) -> list[tuple[int, T]]:
        late = came - stamp
        self._lead = late if self._lead is None else min(self._lead, late)
        if self._resumed is not None and stamp <= self._resumed:
            self.repeated += 1
            return []
        if self._first is not None and self.newest is not None and stamp > self.newest:
            step = stamp - self.newest  # the median of all, as it goes
            self._step *= 1.1 if step > self._step else 1.0 / 1.1
            self._step = self._step or float(step)
        self.newest = stamp if self.newest is None else max(self.newest, stamp)
        self._first = (stamp, came) if self._first is None else self._first
        self._known.add(stamp)
        self._order.append(stamp)
        if len(self._order) > KNOWN:
            self._known.discard(self._order.popleft())
        return [(stamp, sample)]

    def _believed(self) -> list[tuple[int, T]]:
        """What was held goes out: after a pause, or moved where the clock was set."""
        held, self._held = self._held, []
        stamp, came, _ = held[0]
        step = 1 if self.newest is None else stamp + self._shift - self.newest
        span = held[-1][0] - stamp, held[-1][1] - came
        hurried = self._hurried(came) or span[0] > HURRIED * span[1] + FAR // 10
        told = self.arrives and not hurried
        if self.newest is not None and (told or not 0 < step <= _MONTH):
            passed = 0 if self._lead is None else came - self._lead - self.newest
            self._shift = self.newest + max(passed, GAP if self._lead is None else 1) - stamp
            self.set += 1
        self._lead = None
        return [one for t, at, sample in held for one in self._out(t + self._shift, at, sample)]
