"""The course that an indicator will take: when it passes level after level.

Life is the first passage over the limit. The same question for the levels on the way there gives
the course: with T_L the time at which level L is passed, the indicator has reached L at time t with
probability P(T_L ≤ t). So a band over time, and a value at a date, say exactly what the lives say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evertwin.prognosis.laws import Fleet, Indicator, Life, Workload, predict_life
from evertwin.prognosis.laws.growth.way import way_of
from evertwin.prognosis.laws.series.scaled import steady
from evertwin.types import Float64, Vector

LEVELS = 8
RECENT = 7
"""Values that today's level is taken from."""
SHOWN = 3
"""Laws whose courses are told one by one."""


@dataclass(frozen=True)
class Course:
    """Levels on the way to the limit and beyond, and when each is passed.

    >>> Course(np.array([1.0]), (), 1.0).levels.tolist()
    [1.0]
    """

    levels: Vector
    """In the direction of wear, (m,)."""
    lives: tuple[Life, ...]
    sign: float
    """+1 where wear grows."""

    def times(self, probabilities: Sequence[float]) -> Float64[np.ndarray, "m q"]:
        """Time from now at which each level is passed with each probability."""
        rows = [[life.quantile(p) for p in probabilities] for life in self.lives]
        found: Float64[np.ndarray, "m q"] = np.maximum.accumulate(np.array(rows), axis=0)
        return found

    def through(self, work: Workload) -> Course:
        """The course in time, where so much work is planned."""
        return replace(self, lives=tuple(life.through(work, life.unit) for life in self.lives))

    def value(self, after: float, probability: float) -> float:
        """The value that is not passed at time ``after`` with ``probability``, towards wear."""
        reached = np.array([life.probability_before(after) for life in self.lives])
        reached = np.minimum.accumulate(reached)
        # levels rise towards wear, the chance to have reached them falls
        beyond = 1.0 - reached
        order = self.sign * self.levels
        return float(self.sign * np.interp(probability, beyond, order))


def course(
    indicator: Indicator, life: Life, laws: Sequence[str], fleet: Fleet | None
) -> Course | None:
    """The course from today's value to the limit, and as far again; None if it cannot be told."""
    own = indicator.since_replaced()
    known = np.isfinite(own.value)
    if not known.any() or not np.isfinite(life.median) or life.median <= 0.0:
        return None
    sign, limit = indicator.limit.sign, indicator.limit.value
    at = own.at[known][-RECENT:]
    slope, level = steady(at, own.value[known][-RECENT:])
    start = level + slope * float(own.at[-1] - at[-1])
    way = limit - start
    if not sign * way > 0.0:
        return None
    levels, lives = [start], [replace(life, remaining=np.zeros_like(life.remaining))]
    if fleet is not None:
        return _by_likes(Course(np.array(levels), tuple(lives), sign), indicator, life, fleet)
    for share in np.concatenate([np.linspace(0.0, 1.0, LEVELS + 1)[1:-1], [1.0, 1.5, 2.0]]):
        level = start + float(share) * way
        there = indicator.with_(limit=replace(indicator.limit, value=level))
        found = life if share == 1.0 else predict_life(there, laws)
        if isinstance(found, Life):
            levels.append(level)
            lives.append(found)
    return Course(np.array(levels), tuple(lives), sign)


def courses_by_law(indicator: Indicator, life: Life) -> dict[str, Course]:
    """The courses of the laws of most weight, each taken for certain."""
    found = {}
    for law in sorted(life.laws, key=lambda law: -life.laws[law])[:SHOWN]:
        own = predict_life(indicator, (law,))
        way = course(indicator, own, (law,), None) if isinstance(own, Life) else None
        if way is not None:
            found[law] = way
    return found


def _by_likes(begun: Course, indicator: Indicator, life: Life, fleet: Fleet) -> Course | None:
    """The course to the limit that like machines took, over the time that is left here."""
    way = way_of(indicator)
    if way is None:
        return None
    left = np.linspace(0.0, 1.0, LEVELS + 1)[1:]
    shares = fleet.shares(way, (1.0 - left) * float(way.level[-1]))
    shares[-1] = 1.0
    levels = begun.levels[0] + left * (indicator.limit.value - begun.levels[0])
    lives = tuple(replace(life, remaining=share * life.remaining) for share in shares)
    return Course(np.append(begun.levels, levels), (*begun.lives, *lives), begun.sign)
