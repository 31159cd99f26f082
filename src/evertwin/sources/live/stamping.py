"""The clock of a live source: nothing twice, and no stamp can stop a twin.

A stamp that came before, with the same values, is repeated. One far ahead of what the time of
arrival allows, or far behind the newest, or with other values than came with it, is held: if the
samples after it return to the old clock it was one bad stamp; if `CONFIRM` samples go on from it
the machine's clock was set, and from there on stamps are moved to go on where the old clock was,
because intervals stay true when a clock does not; a clock that goes back to where it was before is
taken as it is again. A stamp a little behind is late: it goes out, for the twin has slack for it,
or leaves it out and says so. So is one far behind that its number says is late, or that lies where
stamps are missing and came alone or faster than the machine makes them: what a gateway kept.
Samples that were kept somewhere and come at once are old, never ahead.

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
from typing import Generic, NamedTuple, TypeVar

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
HOLES = 256
"""Stretches without a stamp that are remembered, to know what comes late."""
CLOCKS = 16
"""Clocks that are remembered."""
WIDE = 1.5
"""Steps from which on a stamp is missing."""
FASTER = 2.0
"""Times the machine's own pace, from which on it was not made as it comes."""
BACK = FAR // 10
"""A clock that comes so near [ns] to one that held before is that."""
_DAY = 86_400 * 10**9
_MONTH = 31 * _DAY
_ANCHOR = time.time_ns() - time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def arrival() -> int:
    """Now [ns, Unix], on a clock that nobody sets while this process runs.

    >>> arrival() < arrival()
    True
    """
    return _ANCHOR + time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class Told(NamedTuple, Generic[T]):
    """A sample, and its values as a hash.

    >>> Told("a", 5).said
    5
    """

    sample: T
    said: int


class Stamping(Generic[T]):
    """The state along one source; `take` every sample. See the module for an example."""

    def __init__(self, *, arrives: bool = True) -> None:
        self.arrives = arrives
        """Do times of arrival mean anything? Not for files that are read as fast as they can."""
        self.polled = False
        """Is nothing that came sent again, as brokers do? Then what is behind it after a start is a
        clock that was set."""
        self.newest: int | None = None
        self.judged: int | None = None
        """Stamp of the last sample, on the clock that goes out."""
        self.repeated = 0
        self.rejected = 0
        """Single stamps of no clock."""
        self.set = 0
        """How often the machine's clock was set."""
        self.late = 0
        """Samples far behind the newest that went out in their place."""
        self._resumed: int | None = None
        self._shift = 0
        self._shifts: deque[int] = deque([0], maxlen=CLOCKS)
        """Of all clocks that held."""
        self._holes: deque[tuple[int, int]] = deque(maxlen=HOLES)
        self._lead: int | None = None
        """Smallest delay between stamp and arrival so far [ns]."""
        self._step = 0.0
        """What lies between two stamps, mostly [ns]."""
        self._first: tuple[int, int] | None = None
        """First stamp, and its arrival."""
        self._came = self._noted = 0
        """Arrival of the newest sample, and of the newest one with which the clock was kept."""
        self._fast = False
        """Did stamps go faster than the clock here before this start?"""
        self._held: list[tuple[int, int, Told[T]]] = []
        self._known: dict[int, int] = {}
        """Stamp → what its values were."""

    @property
    def holds(self) -> bool:
        """Do samples wait for others that agree with them?"""
        return bool(self._held)

    def resume(self, stamp: int) -> None:
        """Go on after the newest stamp that is stored."""
        self._resumed = stamp
        if self.arrives:  # a file is read from its beginning: its clock is as it was then
            self.newest = stamp

    def go_on(self, clock: tuple[int, ...]) -> bool:
        """With the clock that was kept (`lasting`): is it one that was set?"""
        self._shift, self._lead, fast = clock
        self._shifts.append(self._shift)
        self._fast = bool(fast)
        return self._shift != 0

    def lasting(self) -> tuple[int, ...] | None:
        """What a process after this one needs to go on with this clock; once in a while, unless
        it was set."""
        rare = not self._shift and self._came < self._noted + AGAIN
        if not self.arrives or self._lead is None or rare:
            return None
        self._noted = self._came
        return self._shift, self._lead, int(self._hurried(self._came))

    def take(
        self, stamp: int, came: int, sample: T, said: int = 0, late: bool = False
    ) -> list[tuple[int, T]]:
        """The samples that go out now, each with its stamp [ns].

        Args:
            stamp: of the sample [ns].
            came: its `arrival` [ns].
            sample: what is kept with it.
            said: its values, as a hash.
            late: does its number say that it is of before the newest?
        """
        moved = self.judged = stamp + self._shift
        if self._first is None:
            self._trusts(came)
        again = bool(self._held) and stamp == self._held[-1][0]
        if again or self._repeats(moved, said):
            self.repeated += 1
            return []
        one = Told(sample, said)
        if late and self._within(moved):
            return self._out(moved, came, one)
        if self._follows(moved, came):
            return [*self._drop(), *self._out(moved, came, one)]
        before = self._drop() if self._held and not self._joins(stamp) else []
        self._held.append((stamp, came, one))
        if len(self._held) <= CONFIRM or self._may_have_come(came):
            return before
        return [*before, *(self._drop() if self._kept() else self._believed())]

    def _within(self, stamp: int) -> bool:
        """Is it one of the time that was heard here?"""
        if self._first is None or self.newest is None:
            return False
        return self._first[0] <= stamp < self.newest

    def _trusts(self, came: int) -> None:
        """The delay that was kept says nothing where the clock here was set back meanwhile."""
        if self._lead is not None and self.newest is not None and came - self._lead <= self.newest:
            self._lead = None

    def _repeats(self, stamp: int, said: int) -> bool:
        """Has it come? Not for sure if it goes on from what is held, or says other than what came
        with its stamp, unless that is the newest: some clocks are coarse."""
        if stamp not in self._known or not self.arrives:
            return stamp in self._known
        on = bool(self._held) and self._joins(stamp - self._shift)
        return not on and (stamp == self.newest or said == self._known[stamp])

    def _may_have_come(self, came: int) -> bool:
        """Are those that are held what came before: sent again at a start, or late in parts?"""
        oldest, began, _ = self._held[0]
        stamp, resumed = oldest + self._shift, self._resumed
        fresh = resumed is not None and self._first is None and stamp <= resumed
        return came - began < AGAIN and (fresh or stamp in self._known)

    def _drop(self) -> list[tuple[int, T]]:
        """What was held is no clock: it came before, or is late, or is of none."""
        held = self._held
        again = bool(held) and self._may_have_come(held[-1][1])
        self._held = []
        out = list[tuple[int, T]]()
        for stamp, came, sample in held:
            if again or stamp + self._shift in self._known:
                self.repeated += 1
            elif self._lacks(stamp):
                out += self._out(stamp + self._shift, came, sample)
            else:
                self.rejected += 1
        return out

    def _lacks(self, stamp: int) -> bool:
        """Is a sample missing where this one lies?"""
        moved = stamp + self._shift
        return self.arrives and any(a < moved < b for a, b in self._holes)

    def _kept(self) -> bool:
        """Are those that are held what a gateway kept? It sends them faster than they are made."""
        if self._first is None or self.newest is None:
            return False
        stamp, began = self._first
        own = (self.newest - stamp) / max(self._came - began, 1)
        (first, at, _), (last, came, _) = self._held[0], self._held[-1]
        fast = last - first > FASTER * own * max(came - at, 1)
        return fast and all(self._lacks(stamp) for stamp, _, _ in self._held)

    def _follows(self, stamp: int, came: int) -> bool:
        """Is it on the clock that holds so far?"""
        if stamp in self._known:
            return False
        if self.newest is None:
            return not self.arrives or stamp <= came + _DAY
        behind = 0 if self.polled and self._first is None else FAR
        if stamp < self.newest - behind:
            return False
        if not self.arrives or self._hurried(came):
            return stamp <= self.newest + max(FAR, min(int(STEPS * self._step), _MONTH))
        lead = self._lead
        if self._first is None and lead is not None:
            lead = min(lead, 0)  # as it was kept: by a clock here that may have been fast
        # without any, the first one after a start: the machine may have stood for any time
        ahead = came - stamp < lead - FAR if lead is not None else stamp > came + _DAY
        return not ahead or stamp <= self.newest + FAR

    def _joins(self, stamp: int) -> bool:
        """Does it go on from what is held?"""
        held = [t for t, _, _ in self._held]
        most = max(FAR, STEPS * (held[1] - held[0])) if len(held) > 1 else _MONTH
        return 0 < stamp - held[-1] <= most

    def _hurried(self, came: int) -> bool:
        """Do stamps go faster than the clock here: a machine in time-lapse, or what was kept?"""
        if self._first is None or self.newest is None:
            return self._fast
        stamp, began = self._first
        return self.newest - stamp > HURRIED * (came - began) + FAR // 10

    def _out(self, stamp: int, came: int, sample: Told[T]) -> list[tuple[int, T]]:
        late = came - stamp
        self._lead = late if self._lead is None else min(self._lead, late)
        stored = self._resumed is not None and stamp <= self._resumed
        self.repeated += stored
        if stored and self.arrives:
            return []
        if self._first is not None and self.newest is not None and stamp > self.newest:
            step = stamp - self.newest  # the median of all, as it goes
            if self._step and step > WIDE * self._step:
                self._holes.append((self.newest, stamp))
            self._step *= 1.1 if step > self._step else 1.0 / 1.1
            self._step = self._step or float(step)
        self.late += self.newest is not None and stamp < self.newest - FAR
        self.newest = stamp if self.newest is None else max(self.newest, stamp)
        self._first = (stamp, came) if self._first is None else self._first
        self._came = came
        self._known[stamp] = sample.said
        if len(self._known) > KNOWN:
            del self._known[next(iter(self._known))]
        return [] if stored else [(stamp, sample.sample)]

    def _goes_on(self, stamp: int) -> int | None:
        """Shift of a clock that held before and by which a stamp goes on from the newest."""
        assert self.newest is not None
        most = max(FAR, min(int(STEPS * self._step), _MONTH))
        found = [one for one in self._shifts if 0 < stamp + one - self.newest <= most]
        return min(found, key=lambda one: abs(one - self._shift), default=None)

    def _believed(self) -> list[tuple[int, T]]:
        """What was held goes out: after a pause, or moved where the clock was set."""
        held, self._held = self._held, []
        stamp, came, _ = held[0]
        step = 1 if self.newest is None else stamp + self._shift - self.newest
        span = held[-1][0] - stamp, held[-1][1] - came
        hurried = self._hurried(came) or span[0] > HURRIED * span[1] + FAR // 10
        told = self.arrives and not hurried
        before = None if told or self.newest is None else self._goes_on(stamp)
        if before is not None:
            self._shift, self.set = before, self.set + 1
        elif self.newest is not None and (told or not 0 < step <= _MONTH):
            passed = (
                came - self._lead - self.newest if self._lead is not None and self.arrives else 0
            )
            # of a file it is by its rows alone: who reads it again finds the same
            steps = hurried or not self.arrives
            least = GAP if self._lead is None else int(self._step) if steps else 1
            shift = self.newest + max(passed, least, 1) - stamp
            near = min(self._shifts, key=lambda one: abs(one - shift))
            self._shift = near if told and abs(near - shift) <= BACK else shift
            self._shifts.append(self._shift)
            self.set += 1
        self._lead = None
        return [one for t, at, sample in held for one in self._out(t + self._shift, at, sample)]
