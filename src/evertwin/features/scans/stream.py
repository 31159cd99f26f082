"""The fused pose as it is known at each moment: poses of scans come late, and out of order.

A scan is matched after it was taken; meanwhile the wheels went on. What arrives is put where its
stamp belongs, and what came after it is gone through again. So the order of arrival changes nothing
once all has arrived, as long as nothing comes later than `HOLD`.

>>> wheels = [Turned(k * 10**8, np.array([0.1 * k, 0.0, 0.0]), np.nan) for k in range(6)]
>>> seen = (3 * 10**8, Sighting(np.array([0.2, 0.1, 0.0]), np.eye(3) * 1e6))
>>> live = Stream.begun(Belief.at_rest(0, np.zeros(3), np.eye(3) * 1e-4), wheels[0])
>>> for one in wheels[1:]:
...     live = live.moved(one)
>>> live.seen(*seen).belief.pose.round(2).tolist()
[0.37, 0.1, 0.0]
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from typing import NamedTuple

import numpy as np

from evertwin.features.scans.fusion import Belief, Sighting, Step, measured, predicted
from evertwin.signals.planar import between
from evertwin.types import Float64

HOLD = 2 * 10**9
"""How late what arrives may be [ns]."""


class Turned(NamedTuple):
    """Where wheels and gyro have turned to.

    >>> Turned(0, np.zeros(3), 0.0).t
    0
    """

    t: int
    """[ns]"""
    pose: Float64[np.ndarray, " 3"]
    """Of the wheels."""
    angle: float
    """Of the gyro [rad]; NaN without one."""

    def at(self, t: int, after: Turned) -> Turned:
        """Between here and ``after``, in proportion to the time."""
        share = (t - self.t) / max(after.t - self.t, 1)
        pose = self.pose + share * (after.pose - self.pose)
        return Turned(t, pose, self.angle + share * (after.angle - self.angle))


class At(NamedTuple):
    """What is believed at a time, where the wheels were then, and at the last scan before.

    >>> At._fields
    ('belief', 'wheels', 'since')
    """

    belief: Belief
    wheels: Turned
    since: Turned


Seen = tuple[int, Sighting]
"""When a scan was taken [ns], and its pose."""


class Stream(NamedTuple):
    """What is known by now. See the module for an example."""

    base: At
    """Before all that may still be late."""
    passed: tuple[At, ...] = ()
    """At each word of the wheels since."""
    sightings: tuple[Seen, ...] = ()
    """Since then too; one newer than the wheels waits for them."""
    late: int = 0
    """What came too late to be used."""

    @classmethod
    def begun(cls, belief: Belief, wheels: Turned) -> Stream:
        """At a pose."""
        return cls(At(belief, wheels, wheels))

    @property
    def now(self) -> At:
        """At the newest word of the wheels."""
        return self.passed[-1] if self.passed else self.base

    @property
    def belief(self) -> Belief:
        """Now."""
        return self.now.belief

    def moved(self, wheels: Turned) -> Stream:
        """With what wheels and gyro say of a time."""
        if wheels.t <= self.base.wheels.t:
            return self._replace(late=self.late + 1)
        k = bisect_right([one.wheels.t for one in self.passed], wheels.t)
        return self._from(k, (wheels, *(one.wheels for one in self.passed[k:])))._shorter()

    def seen(self, t: int, sighting: Sighting) -> Stream:
        """With the pose of a scan that was taken at ``t``."""
        if t < self.base.wheels.t:
            return self._replace(late=self.late + 1)
        kept = [*self.sightings]
        insort(kept, (t, sighting), key=lambda one: one[0])
        k = bisect_right([one.wheels.t for one in self.passed], t)
        grown = self._replace(sightings=tuple(kept))
        return grown._from(k, tuple(one.wheels for one in self.passed[k:]))

    def _from(self, k: int, wheels: tuple[Turned, ...]) -> Stream:
        """Gone through again from the ``k``-th word of the wheels on."""
        at = self.passed[k - 1] if k else self.base
        passed = list(self.passed[:k])
        for one in wheels:
            at = _along(at, one, self.sightings)
            passed.append(at)
        return self._replace(passed=tuple(passed))

    def _shorter(self) -> Stream:
        """Without what is older than `HOLD`."""
        old = bisect_left([one.wheels.t for one in self.passed], self.now.wheels.t - HOLD)
        if not old:
            return self
        base = self.passed[old - 1]
        left = tuple(one for one in self.sightings if one[0] >= base.wheels.t)
        return self._replace(base=base, passed=self.passed[old:], sightings=left)


def _along(at: At, end: Turned, sightings: tuple[Seen, ...]) -> At:
    """To the next word of the wheels, by the scans that were taken on the way."""
    belief, begin, since = at
    due = bisect_left(sightings, begin.t, key=lambda one: one[0])
    for t, sighting in sightings[due:]:
        if t >= end.t:
            break
        middle = begin.at(t, end)
        way = float(np.hypot(*(middle.pose - since.pose)[:2]))
        belief = measured(_step(belief, begin, middle), sighting, way).belief
        begin = since = middle
    return At(_step(belief, begin, end), end, since)


def _step(belief: Belief, begin: Turned, end: Turned) -> Belief:
    step = between(begin.pose, end.pose)
    return predicted(belief, Step(end.t - begin.t, step, end.angle - begin.angle))
