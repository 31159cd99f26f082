"""What a fleet of like machines tells before the first value: lives, laws, and how far to trust.

* **Life.** Lives that ended and ages of machines that still run give a log-normal density of the
  life, averaged over its two parameters on a grid: few lives, a wide density.
* **Laws.** The share of each law in the histories of the fleet, plus half a machine for each law.
* **Interval.** Each machine of the fleet is predicted from what was known at several moments of its
  life. Had the probability of its true life been told right, these probabilities would be even
  between 0 and 1. A new prediction's probability p becomes G(p), the share of them below p, with
  those weighted more that were made at a like share of the predicted life (localised conformal
  prediction), and with an even share worth `EVEN` predictions mixed in.

>>> fleet = Fleet.of_lives([90.0, 100.0, 110.0])
>>> age = np.array([40.0, 100.0, 250.0])
>>> bool(np.argmax(fleet.density(age)) == 1)
True

* **Level.** How long each machine still lasted where its level was as it is here now, at the age
  nearest to this one's. It needs no law; the logarithms of all quantiles are moved `LEVEL` of the
  way to it, as loses least on drawn wear (`python -m proofs.believed --laws seen`).

Sources: Vovk, Gammerman, Shafer, "Algorithmic Learning in a Random World" (2005); Guan, "Localized
conformal prediction" (2023).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import scipy

from evertwin.errors import UsageError
from evertwin.prognosis.laws.life import LEVELS
from evertwin.types import Float64

EVEN = 30.0
"""Predictions that the even share is worth."""
LEAST = 3
"""Machines that ended from which their levels tell something."""
LEVEL = 0.7
"""Weight of the levels of like machines beside the laws."""
CLOSE = 0.2
"""Standard deviation of the logarithm of a life that is added to that of such machines."""
ALIKE = 0.03
"""Share of the way to the limit by which levels differ that are alike."""
NEAR = 0.2
"""Distance in the share of life that has passed at which a prediction counts less."""
SPREADS: Float64[np.ndarray, " k"] = np.geomspace(0.03, 1.5, 24)
"""Standard deviations of the logarithm of the life."""


class Way(NamedTuple):
    """How the level of a machine rose until its end.

    >>> Way(np.array([0.0, 5.0]), np.array([0.0, 1.0]), 5.0).left(1.0, 4.0, 0.1)
    0.0
    """

    age: Float64[np.ndarray, " n"]
    level: Float64[np.ndarray, " n"]
    """Towards the limit; never falls."""
    end: float

    def left(self, level: float, age: float, about: float) -> float:
        """How long it still lasted at a level: at the row nearest in age of those about there."""
        near = np.flatnonzero(np.abs(self.level - level) <= about)
        if len(near):
            k = int(near[np.argmin(np.abs(self.age[near] - age))])
        else:
            k = min(int(np.searchsorted(self.level, level)), len(self.age) - 1)
        return max(self.end - float(self.age[k]), 0.0)


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


@dataclass(frozen=True)
class Fleet:
    """Prior knowledge from like machines. Build with `Fleet.of_lives` or `learn`.

    >>> Fleet().laws
    {}
    """

    centre: Float64[np.ndarray, " g"] = field(default_factory=lambda: np.zeros(0))
    """Log-normal components of the life's density: mean of the logarithm."""
    spread: Float64[np.ndarray, " g"] = field(default_factory=lambda: np.zeros(0))
    share: Float64[np.ndarray, " g"] = field(default_factory=lambda: np.zeros(0))
    laws: Mapping[str, float] = field(default_factory=dict)
    """Prior weight of each law; empty: all alike."""
    ranks: Float64[np.ndarray, " n"] = field(default_factory=lambda: np.zeros(0))
    """Probabilities that predictions gave to life ending no later than it did."""
    passed: Float64[np.ndarray, " n"] = field(default_factory=lambda: np.zeros(0))
    """Share of the predicted life that had passed, per prediction."""
    trust: Float64[np.ndarray, " n"] = field(default_factory=lambda: np.zeros(0))
    """Weight of each rank, 0 to 1."""
    ways: tuple[Way, ...] = ()
    """Of each machine that ended."""
    members: tuple[Member, ...] = ()
    """Every life that it was learned from."""

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
        return (f"fleet: {len(ended)} ended, at {span}{rest}", *(sudden if early else ()))

    @classmethod
    def of_lives(
        cls, ended: Sequence[float] | np.ndarray, running: Sequence[float] | np.ndarray = ()
    ) -> Fleet:
        """From whole lives and from the ages of machines that still run.

        Raises `UsageError` unless at least two lives ended, all above 0.
        """
        lives = np.asarray(ended, dtype=np.float64)
        ages = np.asarray(running, dtype=np.float64)
        if len(lives) < 2 or np.any(lives <= 0.0) or np.any(ages < 0.0):
            raise UsageError(
                f"fleet: expected at least two lives above 0 that ended, got {len(lives)}"
            )
        x = np.log(lives)
        wide = max(3.0 * float(np.std(x)), 1.0)
        centres = np.linspace(x.mean() - wide, x.mean() + wide, 61)
        centre, spread = (a.ravel() for a in np.meshgrid(centres, SPREADS, indexing="ij"))
        z = (x[:, None] - centre) / spread
        log = np.sum(-0.5 * z * z - np.log(spread), axis=0)
        young = ages[ages > 0.0]
        if len(young):
            log = log + scipy.special.log_ndtr((centre - np.log(young)[:, None]) / spread).sum(
                axis=0
            )
        share = np.exp(log - log.max())
        kept = share > 1e-4
        return cls(centre[kept], spread[kept], share[kept] / share[kept].sum())

    def density(self, age: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, " m"]:
        """Density of the whole life at ``age``."""
        z = (np.log(age)[:, None] - self.centre) / self.spread
        whole: Float64[np.ndarray, " m"] = (np.exp(-0.5 * z * z) / self.spread) @ self.share
        out: Float64[np.ndarray, " m"] = whole / (np.sqrt(2.0 * np.pi) * age)
        return out

    def beyond(self, age: float) -> float:
        """Probability that a life lasts beyond ``age``."""
        return float(
            np.exp(scipy.special.log_ndtr((self.centre - np.log(age)) / self.spread)) @ self.share
        )

    def ending(self, age: float, left: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, " m"]:
        """Probability that a life of this age ends within ``left``; 0 where no life is known."""
        if not self.knows_lives:
            return np.zeros(len(left))
        z = (self.centre - np.log(age + left)[:, None]) / self.spread
        lasts = np.exp(scipy.special.log_ndtr(z)) @ self.share
        out: Float64[np.ndarray, " m"] = 1.0 - lasts / max(self.beyond(age), 1e-12)
        return np.asarray(np.clip(out, 0.0, 1.0))

    @property
    def knows_lives(self) -> bool:
        """Whether it says anything about the life."""
        return len(self.centre) > 0

    def levelled(
        self, remaining: Float64[np.ndarray, " k"], now: tuple[float, float, float]
    ) -> Float64[np.ndarray, " k"]:
        """Quantiles of a life, moved `LEVEL` of the way to those of machines at this level.

        Args:
            remaining: what was predicted, at `LEVELS`.
            now: level, age, and what two levels may differ by to be alike.
        """
        if len(self.ways) < LEAST:
            return remaining
        found = np.log([max(way.left(*now), 1e-3 * way.end) for way in self.ways])
        middle, spread = float(np.median(found)), float(np.hypot(np.std(found), CLOSE))
        level = middle + spread * scipy.special.ndtri(LEVELS)
        known = np.isfinite(remaining)
        own = np.log(np.maximum(np.where(known, remaining, 1.0), 1e-3 * np.exp(middle)))
        out: Float64[np.ndarray, " k"] = np.exp(
            level + (1.0 - LEVEL) * np.where(known, own - level, 0.0)
        )
        return np.maximum.accumulate(out)

    def calibrated(
        self, cdf: Float64[np.ndarray, " m"], passed: float
    ) -> Float64[np.ndarray, " m"]:
        """A distribution function corrected by the fleet's ranks.

        Args:
            cdf: what was predicted.
            passed: share of the predicted life that has passed.
        """
        if not len(self.ranks):
            return cdf
        weight = self.trust * np.exp(-0.5 * ((self.passed - passed) / NEAR) ** 2)
        order = np.argsort(self.ranks)
        below = np.concatenate([[0.0], np.cumsum(weight[order])])
        total = below[-1] + EVEN
        grid = np.concatenate([[0.0], self.ranks[order], [1.0]])
        # Each rank counts half below itself, so that no prediction becomes certain.
        share = np.concatenate([[0.0], 0.5 * (below[1:] + below[:-1]), [below[-1]]])
        out: Float64[np.ndarray, " m"] = (np.interp(cdf, grid, share) + EVEN * cdf) / total
        return out
