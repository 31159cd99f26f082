"""What a fleet of like machines tells: how long each still lasted from where this one is now.

No law is needed. Each machine of the fleet is looked up at the level that this one has now, at the
age nearest to its own among those rows. From there

* *left*: how long it still lasted; one that still runs lasts as long as the others, or longer if it
  already has, and says no more than that: it makes no interval narrower;
* *pace*: how much later this one came to that level; unknown of one that began beyond it.

Let R and x be the logarithms of their medians over the fleet, T that of the distance to the limit
over the newest slope (`Way.tangent`), and A that of what lives of the fleet (taken as
log-normal) last beyond this age, whatever the level. The logarithm of the remaining life is

    R + k·(x − δ) + δ + c·(T − R − δ) + a·(A − R − δ) + b

Where a late machine also lasts longer by as much k is 1; where the pace so far tells nothing of the
pace to come it is 0; where lives are alike and levels scatter a is 1. The fleet says what they are:
each of its machines is asked for by the others at `MOMENTS` of its life, and least squares over
those about as near to their end draw them from `BEFORE` towards what was seen. What is off there
gives b and the quantiles, with the share of `EVEN` question of spread `STRANGE` mixed in.

A fleet may wear at another pace altogether. δ is what of x is that, given how far the paces within
the fleet lie apart (`likeness`, beside this file). It counts in full, in the interval too,
and is said (`Life.pace`). Where the form may be another, that has its chance (`Told.other`).

>>> ways = [Way(k * np.arange(11.0), np.arange(-10.0, 1.0), 10.0 * k) for k in (0.9, 1.0, 1.1)]
>>> told = Fleet.of(ways).told_of(Way(2.0 * np.arange(6.0), np.arange(-10.0, -4.0), np.nan))
>>> 8.0 < float(np.interp(0.5, LEVELS, told.remaining)) < 12.0, round(told.pace, 1)
(True, 2.0)

Source: Guan, "Localized conformal prediction" (2023), for quantiles from what is near.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import scipy

from evertwin.prognosis.laws.growth.way import Way
from evertwin.prognosis.laws.likes.likeness import SHIFT, Likeness, Pace, judged
from evertwin.prognosis.laws.likes.weighted import quantile_of, quantiles_of, shared
from evertwin.prognosis.laws.series.life import LEVELS
from evertwin.types import Bools, Float64, Vector

ALIKE = 0.03
"""Share of the way to the limit by which levels differ that are alike."""
LEAST = 0.01
"""Least share of a life that is told apart from none."""
MOMENTS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.97)
"""Shares of a life at which each machine is asked for by the others."""
BEFORE = np.array([0.4, 0.2, 0.2])
"""k, c and a before anything was seen."""
FIRM = np.array([5.0, 50.0, 5.0])
"""Questions that each is worth."""
NEAR, NEAREST = 0.7, 12
"""Distance in the logarithm of left over age at which a question counts less; so far that as many
count."""
EVEN, STRANGE = 1.0, 0.4
DOUBT = 0.5
"""Share of a shift by which it may be wrong."""
APART = 0.05
"""Least standard deviation of the logarithm of paces, and of lives."""
INNER = 0.7
"""Share of the spread within a fleet that counts: the chance of another form has its tails."""
SLOWER = 2.0
"""Factor of time up to which a level is known later on a slower course."""
FARTHEST = 2.0
"""A counts up to so far from R."""


class Member(NamedTuple):
    """One life of a like machine.

    >>> Member("pump2.csv", "run", 40.0, "running").said
    'pump2.csv still running at 40 run'
    """

    name: str
    clock: str
    age: float
    how: Literal["limit", "failed", "replaced", "running"]
    """It passed its limit; failed before; was replaced in time; or still runs."""

    @property
    def ended(self) -> bool:
        """Whether its life is known whole."""
        return self.how in ("limit", "failed")

    @property
    def said(self) -> str:
        """In words."""
        how = {
            "limit": "passed the limit", "failed": "failed", "replaced": "replaced in time",
            "running": "still running",
        }[self.how]  # fmt: skip
        return f"{self.name} {how} at {self.age:.4g} {self.clock}"


class Told(NamedTuple):
    """What a fleet tells of one machine.

    >>> Told(LEVELS, 1.0, 0.1).pace
    1.0
    """

    remaining: Float64[np.ndarray, " k"]
    """At `LEVELS`."""
    pace: float
    """How much slower the machine wears than its fleet, as a factor of time."""
    other: float
    """Chance that it wears in another form, and nothing of this holds."""


class Asked(NamedTuple):
    """One question to a fleet, as logarithms.

    >>> Asked(0.0, 0.5, 0.0, 0.0, 2.0).pace
    0.5
    """

    left: float
    pace: float
    tangent: float
    """Time by the tangent over ``left``."""
    lives: float
    """Time by the lives of the fleet alone over ``left``."""
    age: float

    def by_lives(self, lives: Lives, shift: float) -> float:
        """``lives`` if the fleet lives ``exp(shift)`` times as long."""
        return lives.beyond(self.age, shift) - self.left - shift


class Lives(NamedTuple):
    """Lives of a fleet, log-normal.

    >>> round(float(np.exp(Lives(np.log(100.0), 0.1).beyond(np.log(50.0)))), 1)
    50.0
    """

    middle: float
    """Median of their logarithms."""
    spread: float
    """Standard deviation of those, outliers apart, and of their median."""

    @classmethod
    def of(cls, ways: Sequence[Way]) -> Lives:
        """A machine that still runs lives as those that lived longer than it has."""
        ended = np.array([np.isfinite(way.end) for way in ways])
        log = np.log([way.end if np.isfinite(way.end) else way.now for way in ways])
        weight = shared(log, np.ones(len(log)), ended)
        middle = quantile_of(log, weight, 0.5)
        spread = max(1.4826 * quantile_of(np.abs(log - middle), weight, 0.5), APART)
        return cls(middle, spread * float(np.sqrt(1.0 + 1.0 / ended.sum())))

    def beyond(self, age: float, shift: float = 0.0) -> float:
        """Logarithm of the median of what they last beyond the logarithm of an age."""
        middle = self.middle + shift
        ended = min(float(scipy.special.ndtr((age - middle) / self.spread)), 1.0 - 1e-9)
        whole = middle + self.spread * float(scipy.special.ndtri(0.5 + 0.5 * ended))
        return age + float(np.log(max(np.expm1(whole - age), LEAST)))

    def remaining(self, age: float, wider: float) -> Float64[np.ndarray, " k"]:
        """What they last beyond an age, at `LEVELS`, with so much more spread."""
        spread = wider * self.spread
        ended = float(scipy.special.ndtr((np.log(age) - self.middle) / spread))
        share = np.minimum(ended + (1.0 - ended) * LEVELS, 1.0 - 1e-9)
        whole = np.exp(self.middle + spread * scipy.special.ndtri(share))
        return np.asarray(np.maximum(whole - age, 0.0))


@dataclass(frozen=True)
class Fleet:
    """Like machines that ended, and others. Build with `Fleet.of`, or `learn` from histories.

    >>> Fleet().told
    ()
    """

    ways: tuple[Way, ...] = ()
    members: tuple[Member, ...] = ()
    """Every life that it was learned from."""
    notes: tuple[str, ...] = ()
    """What may surprise in how they were read."""
    asked: tuple[Asked, ...] = ()
    """Each machine, asked for by the others."""
    off: Vector = field(default_factory=lambda: np.zeros(0))
    """By how much the truth was longer than ``left`` there; of one that still runs at least."""
    ended: Bools = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    """Whether it had ended."""

    @classmethod
    def of(cls, ways: Sequence[Way], members: Sequence[Member] = ()) -> Fleet:
        """From the ways of machines, at least two of which ended."""
        asked, off, ended = [], [], []
        for k, way in enumerate(ways):
            others = [*ways[:k], *ways[k + 1 :]]
            if not any(np.isfinite(one.end) for one in others):
                continue
            lives = Lives.of(others)
            whole = way.end if np.isfinite(way.end) else way.now
            for moment in MOMENTS:
                part = way.until(moment * whole)
                if len(part.age) < 2 or part.now <= 0.0:
                    continue
                one = _ask(others, part, lives)
                asked.append(one)
                off.append(float(np.log(max(whole - part.now, LEAST * whole))) - one.left)
                ended.append(bool(np.isfinite(way.end)))
        return cls(tuple(ways), tuple(members), (), tuple(asked), np.array(off), np.array(ended))

    @property
    def told(self) -> tuple[str, ...]:
        """Who is in it, and what it says of ends before the limit."""
        ended = [one for one in self.members if one.ended]
        others = [one.said for one in self.members if not one.ended]
        if not ended:
            return ()
        ages = [one.age for one in ended]
        span = f"{min(ages):.4g} to {max(ages):.4g} {ended[0].clock}"
        rest = f"; {', '.join(others)}" if others else ""
        early = [one.name for one in ended if one.how == "failed"]
        sudden = (
            f"{len(early)} of {len(ended)} like machines failed before the limit "
            f"({', '.join(early)}): an end without warning is possible",
        )
        read = (f"fleet: {len(ended)} ended, at {span}{rest}", *self.notes)
        return (*read, *(sudden if early else ()))

    def told_of(self, way: Way) -> Told:
        """The life that remains to a machine, and how its pace differs."""
        lived = Lives.of(self.ways)
        one = _ask(self.ways, way, lived)
        asked, weight = self._about(one)
        seen = asked[:, 1:4]
        sure = weight * self.ended
        known = float(sure.sum() / (sure.sum() + EVEN))
        likeness = self._likeness(way, one)
        shift, doubt = self._pace(one).shift(likeness.shifted)
        worth = self._worth(seen, sure)
        rest = self.off - seen @ worth
        # One that still runs counts where it has outlasted most that ended from there.
        longer = rest > quantile_of(rest, sure, 0.5)
        low, off, high = quantiles_of(rest, weight * (self.ended | longer))
        lives = one.by_lives(lived, shift)
        now = np.array([one.pace - shift, np.clip(one.tangent - shift, -1.0, 1.0),
                        np.clip(lives, -FARTHEST, FARTHEST)])  # fmt: skip
        middle = one.left + shift + float(worth @ now) + known * off
        below, above = (
            np.hypot(
                known * side * INNER / 1.2816 * self._few + (1.0 - known) * STRANGE,
                np.hypot(doubt, DOUBT * shift),
            )
            for side in (off - low, high - off)
        )
        scores = scipy.special.ndtri(LEVELS)
        out = np.exp(middle + np.where(scores < 0.0, below, above) * scores)
        return Told(np.asarray(out), float(np.exp(shift)), likeness.other)

    def other(self, way: Way) -> float:
        """Chance that a machine wears in another form than those that ended."""
        return self._likeness(way, _ask(self.ways, way, Lives.of(self.ways))).other

    def _likeness(self, way: Way, one: Asked) -> Likeness:
        ended = [like for like in self.ways if np.isfinite(like.end)]
        return judged(way, ended, self._pace(one))

    def _about(self, one: Asked) -> tuple[Float64[np.ndarray, "n 5"], Float64[np.ndarray, " n"]]:
        """What each machine was asked, and how much it counts for one, by how near its end is."""
        asked = np.array(self.asked).reshape(-1, len(Asked._fields))
        apart = np.abs(asked[:, 0] - asked[:, 4] - (one.left - one.age))
        count = min(NEAREST, len(apart)) - 1
        width = max(NEAR, float(np.sort(apart)[count])) if len(apart) else NEAR
        return asked, np.exp(-0.5 * (apart / width) ** 2)

    def _pace(self, one: Asked) -> Pace:
        asked, weight = self._about(one)
        total = float(weight.sum())
        square = float(weight @ asked[:, 1] ** 2)
        return Pace(one.pace, float(np.hypot(APART, np.sqrt(square / total))) if total else SHIFT)

    @property
    def reach(self) -> float:
        """The level that those that ended came to at most."""
        return reach(self.ways)

    def by_age(self, way: Way) -> Float64[np.ndarray, " k"]:
        """What its lives last beyond the age of a machine, whatever its level."""
        return Lives.of(self.ways).remaining(way.now, self._few)

    def shares(self, way: Way, levels: Vector) -> Vector:
        """Shares of the time that is left at which levels between now and the limit are passed."""
        rows = []
        for like in self.ways:
            if not np.isfinite(like.end):
                continue
            k = like.row(
                float(way.level[-1]),
                float(way.reached[-1]),
                ALIKE * abs(reach(self.ways) - float(way.level[0])),
            )
            there = np.minimum(np.searchsorted(like.level, levels), len(like.age) - 1)
            rest = max(like.end - float(like.age[k]), LEAST * like.end)
            rows.append(np.clip((like.age[there] - like.age[k]) / rest, 0.0, 1.0))
        return np.asarray(np.maximum.accumulate(np.median(rows, axis=0)))

    @property
    def _few(self) -> float:
        """How much wider quantiles are that few machines tell (Student), however often asked."""
        n = max(sum(bool(np.isfinite(way.end)) for way in self.ways), 2)
        return float(scipy.special.stdtrit(n, 0.9) / 1.2816 * np.sqrt(1.0 + 1.0 / n))

    def _worth(
        self, seen: Float64[np.ndarray, "n 3"], weight: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " 3"]:
        """k, c and a, by weighted least squares drawn towards `BEFORE`."""
        if not len(seen):
            return BEFORE
        columns = seen * weight[:, None]
        firm = np.diag(FIRM * np.diag(np.cov(seen.T, aweights=weight + 1e-9, bias=True)) + 1e-9)
        found = np.linalg.solve(columns.T @ seen + firm, columns.T @ self.off + firm @ BEFORE)
        return np.asarray(np.clip(found, 0.0, 1.0))


def reach(ways: Sequence[Way]) -> float:
    """The level that those that ended came to at most; below 0: they failed before the limit."""
    return float(max(way.level[-1] for way in ways if np.isfinite(way.end)))


def _ask(ways: Sequence[Way], one: Way, lives: Lives) -> Asked:
    """What machines, and their lives, tell of one at its last row."""
    level, age = float(one.level[-1]), one.now
    about = ALIKE * abs(reach(ways) - float(one.level[0]))
    (came,) = one.reached_at(slice(-1, None)).tolist()
    left, paces, ended = [], [], []
    for way in ways:
        k = way.row(level, came, about)
        known = bool(np.isfinite(way.end))
        whole = way.end if known else way.now
        # Its age when the level would have been known, if as late on its own course.
        (reached,) = way.reached_at(slice(k, k + 1)).tolist()
        slower = min(max(reached / max(came, 1e-300), 1.0 / SLOWER), SLOWER)
        then = reached + slower * (age - came)
        rest = whole - then
        if float(way.level[0]) <= level + about and (known or way.level[-1] >= level - about):
            least = LEAST * whole
            paces.append(np.log(max(age, least) / max(then, least)))
        if known or rest > 0.0:
            left.append(np.log(max(rest, LEAST * whole)))
            ended.append(known)
    each, over = np.array(left), np.array(ended)
    usual = float(np.median(each[over]))
    middle = float(np.median(np.where(over, each, np.maximum(each, usual))))
    tangent = one.tangent
    off = float(np.clip(np.log(tangent) - middle, -1.0, 1.0)) if tangent > 0.0 else 0.0
    pace = float(np.median(paces)) if paces else 0.0
    age = float(np.log(age))
    by_lives = float(np.clip(lives.beyond(age) - middle, -FARTHEST, FARTHEST))
    return Asked(middle, pace, off, by_lives, age)
