"""Does a machine wear as its like machines do: at their pace, at another one, or in another form?

The form of a course is told by the ages at which `PARTS` of the rise until now were done, as shares
of the age now: whatever the pace, those of one form agree. How far they lie apart among like
machines, at the level that this one has now, tells by how much they may (Student, with a standard
deviation `USUAL` that is worth `WORTH` machines). Of another form they lie `OTHER` apart, and its
pace may be anything (a logarithm of standard deviation `ANY`); of the same form at another pace it
has a standard deviation of `SHIFT`. Before anything is seen the three cases have `CASES`.

>>> age = np.linspace(0.0, 10.0, 101)
>>> straight, late = (Way(age, 10.0 * (age / 10.0) ** k - 10.0, 10.0) for k in (1.0, 3.0))
>>> pace = Pace(0.0, 0.1)
>>> [judged(straight.until(6.0), [one] * 4, pace).other < 0.1 for one in (straight, late)]
[True, False]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.prognosis.laws.growth.way import Way
from evertwin.prognosis.laws.series.life import LEVELS, quantiles
from evertwin.types import Float64, Vector

FEW = 5
"""Values that tell where a life begins."""
PARTS = np.array([0.2, 0.4, 0.6, 0.8])
USUAL, WORTH = 0.03, 3.0
OTHER = 0.15
SHIFT, ANY = 0.7, 1.0
CASES = (0.375, 0.375, 0.25)
"""As they wear; the same at another pace; in another form."""


class Pace(NamedTuple):
    """How much later a machine came to its level than its like machines, as a logarithm.

    >>> Pace(0.7, 0.1).likely(0.7) > Pace(0.7, 0.1).likely(0.0)
    True
    """

    late: float
    spread: float
    """Standard deviation of those of like machines, asked for by the others."""

    def likely(self, wider: float) -> float:
        """How likely it is, up to a factor, with so much more spread."""
        wide = float(np.hypot(self.spread, wider))
        return float(np.exp(-0.5 * (self.late / wide) ** 2) / wide)

    def shift(self, chance: float) -> tuple[float, float]:
        """Mean and standard deviation of what of it is a shift, if there is one by chance."""
        wide = float(np.hypot(self.spread, SHIFT))
        mean = self.late * (SHIFT / wide) ** 2
        square = (SHIFT * self.spread / wide) ** 2 + mean * mean
        return chance * mean, float(np.sqrt(chance * square - (chance * mean) ** 2))


class Likeness(NamedTuple):
    """What a machine is to its fleet.

    >>> Likeness(0.1, 0.2).other
    0.2
    """

    shifted: float
    """Chance of another pace, where the form is the same."""
    other: float
    """Chance of another form."""


def judged(way: Way, ended: Sequence[Way], pace: Pace) -> Likeness:
    """What a machine is to those that ended."""
    same, different = _forms(way, ended)
    alike, shifted, other = (
        case * pace.likely(wider) * form
        for case, wider, form in zip(CASES, (0.0, SHIFT, ANY), (same, same, different), strict=True)
    )
    either = alike + shifted
    return Likeness(float(shifted / either), float(other / (either + other)))


def begun(way: Way) -> float:
    """The level that a life begins with."""
    return float(np.median(way.level[:FEW]))


def _forms(way: Way, ended: Sequence[Way]) -> tuple[float, float]:
    """How likely its course is if the form is theirs, and if it is another; up to a factor."""
    levels = [min(float(way.level[-1]), float(one.level[-1])) for one in ended]
    theirs = [x for one, level in zip(ended, levels, strict=True) if len(x := _course(one, level))]
    own = _course(way, float(way.level[-1]))
    if not theirs or not len(own):
        return 1.0, 1.0
    n, known = len(theirs), WORTH + len(theirs) - 1.0
    square = float(np.mean(np.sum((np.array(theirs) - np.mean(theirs, axis=0)) ** 2, axis=0)))
    spread = float(np.sqrt((WORTH * USUAL**2 + square) / known * (1.0 + 1.0 / n)))
    apart = float(np.sqrt(np.mean((own - np.mean(theirs, axis=0)) ** 2)))
    student = scipy.special.gammaln([0.5 * known + 0.5, 0.5 * known]) @ (1.0, -1.0)
    tail = -0.5 * (known + 1.0) * np.log1p((apart / spread) ** 2 / known)
    same = float(np.exp(student + tail)) / spread / np.sqrt(0.5 * known)
    wide = float(np.hypot(spread, OTHER))
    return same, float(np.exp(-0.5 * (apart / wide) ** 2) / wide)


def _course(one: Way, level: float) -> Vector:
    """Ages at which `PARTS` of the rise to a level were done, over that at the level; or none."""
    first, age = begun(one), one.reached
    done = first + np.append(PARTS, 1.0) * (level - first)
    rising = one.level + 1e-12 * abs(first) * np.arange(len(age))
    at = np.interp(done, rising, age)
    return np.asarray(at[:-1] / at[-1]) if level > first and at[-1] > 0.0 else np.zeros(0)


def by_chance(
    these: Float64[np.ndarray, " k"], others: Float64[np.ndarray, " k"], chance: float
) -> Float64[np.ndarray, " k"]:
    """Quantiles at `LEVELS` of lives that are the others by chance.

    >>> told = by_chance(LEVELS, 9.0 + LEVELS, 0.2)
    >>> [round(float(np.interp(p, LEVELS, told)), 2) for p in (0.4, 0.9)]
    [0.5, 9.5]
    """
    nodes = np.unique(np.concatenate([these, others]))
    nodes = nodes[np.isfinite(nodes)]
    below = [np.searchsorted(x, nodes, side="right") for x in (these, others)]
    known = np.append(0.0, LEVELS)
    known[-1] = 1.0
    return quantiles(nodes, (1.0 - chance) * known[below[0]] + chance * known[below[1]])


def at_some_age(age: float) -> Float64[np.ndarray, " k"]:
    """What is left to a component of which no more is known than that it has come to an age.

    It is looked at somewhere in its life, as probably here as there.
    """
    return np.asarray(age * LEVELS / (1.0 - LEVELS))
