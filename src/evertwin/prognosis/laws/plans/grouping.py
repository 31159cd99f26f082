"""Which components are maintained in one stop: a stop costs the same, whatever is done in it.

Moving a component from its own best date to another date t costs

    h(t) = c(t) − g·u(t) ≥ 0

with c the mean cost of this life, u its mean time in use and g the least cost per time of use, its
own stops included (Wildeman, Dekker and Smit 1997). A stop that several share is paid once, if one
of them at least has lasted until then: V·(1 − ∏F(t)). Groups are sought that cost least in all:
from single components on, the two groups are joined that save most, then components move from
group to group, as long as something is saved.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from evertwin.prognosis.laws.plans.renewal import Renewal, Windows
from evertwin.types import Float64, Vector

LEAST = 1e-9
"""What is saved must be more than this share of a stop's cost."""


@dataclass(frozen=True)
class Member:
    """One component on its way into a group.

    >>> Member.__name__
    'Member'
    """

    name: str
    renewal: Renewal
    """Its costs hold for maintenance in a stop of its own."""
    own: float
    """Its own best date; infinite: run to failure."""
    rate: float
    """Cost per time of use there."""
    earliest: float = 0.0
    exact: float | None = None
    """The only possible date; None: any."""

    def penalty(self, dates: Vector, visit: float) -> Vector:
        """What each date costs more than the own one, without any stop."""
        rate = self.rate if np.isfinite(self.rate) else 0.0
        stop = visit * (1.0 - self.renewal.failure(dates))
        return self.renewal.expected(dates) - rate * self.renewal.used(dates) - stop


@dataclass(frozen=True)
class Group:
    """Components of one stop.

    >>> Group(("a", "b"), 20.0, 1.0, 3.0).saving
    2.0
    """

    names: tuple[str, ...]
    after: float
    """Infinite: run to failure."""
    cost: float
    """Beyond each component's cost with an own date and an own stop, where nothing were said."""
    alone: float = 0.0
    """The same, if each had a stop of its own."""

    @property
    def saving(self) -> float:
        """What is saved by one stop for all."""
        return max(self.alone - self.cost, 0.0)  # below zero by rounding alone


def together(members: Sequence[Member], windows: Windows | None, visit: float) -> tuple[Group, ...]:
    """Groups and their dates, the earliest first.

    Args:
        members: the components.
        windows: possible dates; None: any time.
        visit: cost of one stop.
    """
    search = _Search(windows, visit)
    found = [search.group((one,)) for one in members]
    parts: dict[str, Member] = {one.name: one for one in members}
    if visit > 0.0:
        found = _moved(_joined(found, parts, search), parts, search)
    found = _same_date(found, parts, search)
    return tuple(sorted(found, key=lambda one: (one.after, one.names)))


def _joined(found: list[Group], parts: dict[str, Member], search: _Search) -> list[Group]:
    """Joins the two groups that save most, again and again."""
    while True:
        best, pair, merged = search.least, None, None
        for a, b in itertools.combinations(found, 2):
            both = search.group(tuple(parts[n] for n in (*a.names, *b.names)))
            if a.cost + b.cost - both.cost > best:
                best, pair, merged = a.cost + b.cost - both.cost, (a, b), both
        if pair is None or merged is None:
            return found
        found = [one for one in found if one not in pair] + [merged]


def _moved(found: list[Group], parts: dict[str, Member], search: _Search) -> list[Group]:
    """Moves one component to another group, or to none, as long as that saves something."""
    gained = True
    while gained:
        gained = False
        for name, member in parts.items():
            home = next(one for one in found if name in one.names)
            rest = tuple(parts[n] for n in home.names if n != name)
            left = search.group(rest) if rest else None
            others = [one for one in found if one is not home]
            for target in (*others, None if rest else home):
                if target is home:
                    continue
                names = () if target is None else target.names
                new = search.group((*(parts[n] for n in names), member))
                before = home.cost + (0.0 if target is None else target.cost)
                after = new.cost + (0.0 if left is None else left.cost)
                if before - after > search.least:
                    kept = [one for one in others if one is not target]
                    found = [*kept, new, *([] if left is None else [left])]
                    gained = True
                    break
    return found


def _same_date(found: list[Group], parts: dict[str, Member], search: _Search) -> list[Group]:
    """Groups of one date are one stop."""
    dates: dict[float, tuple[Member, ...]] = {}
    late = [one for one in found if not np.isfinite(one.after)]
    for one in found:
        if np.isfinite(one.after):
            dates[one.after] = (*dates.get(one.after, ()), *(parts[n] for n in one.names))
    return late + [search.at(whole, date) for date, whole in dates.items()]


class _Search:
    """The best date of a group."""

    def __init__(self, windows: Windows | None, visit: float) -> None:
        self.windows, self.visit = windows, visit
        self.least = LEAST * visit
        self._known: dict[frozenset[str], Group] = {}

    def cost(self, members: Sequence[Member], dates: Vector) -> Vector:
        """Cost of a group at each of some dates."""
        failed = np.prod([one.renewal.failure(dates) for one in members], axis=0)
        moved = np.sum([one.penalty(dates, self.visit) for one in members], axis=0)
        out: Vector = moved + self.visit * (1.0 - failed)
        return out

    def at(self, members: Sequence[Member], date: float) -> Group:
        """The group at a date."""
        alone = sum(self.group((one,)).cost for one in members)
        cost = float(self.cost(members, np.array([date]))[0])
        return Group(tuple(one.name for one in members), date, cost, alone)

    def group(self, members: tuple[Member, ...]) -> Group:
        """The group at its best date; of infinite cost, if its members have none in common."""
        key = frozenset(one.name for one in members)
        if key not in self._known:
            self._known[key] = self._group(members)
        return self._known[key]

    def _group(self, members: tuple[Member, ...]) -> Group:
        names = tuple(one.name for one in members)
        fixed = {one.exact for one in members if one.exact is not None}
        earliest = max(one.earliest for one in members)
        if len(members) == 1 and not fixed and earliest <= members[0].own:
            return Group(names, members[0].own, 0.0)
        if len(fixed) > 1 or any(date < earliest for date in fixed):
            return Group(names, np.inf, np.inf)
        dates = np.array(sorted(fixed)) if fixed else self._dates(members, earliest)
        costs = self.cost(members, dates)
        k = int(np.argmin(costs))
        return Group(names, float(dates[k]), float(costs[k]))

    def _dates(self, members: Sequence[Member], earliest: float) -> Vector:
        """Dates between which nothing cheaper lies."""
        own = [one.own for one in members if np.isfinite(one.own)]
        knots = np.concatenate([[earliest], own, *(one.renewal.times for one in members)])
        dates = self._possible(np.unique(knots[knots >= earliest]), earliest)
        costs = self.cost(members, dates)
        k = int(np.argmin(costs))
        low, high = dates[max(k - 1, 0)], dates[min(k + 1, len(dates) - 1)]
        if not high > low:
            return dates
        found = scipy.optimize.minimize_scalar(
            lambda x: float(self.cost(members, np.array([x]))[0]), bounds=(low, high),
            method="bounded", options={"xatol": 1e-6 * (high - low)},
        )  # fmt: skip
        near = self._possible(np.array([float(found.x)]), earliest)
        return np.union1d(dates, near)

    def _possible(
        self, dates: Float64[np.ndarray, " n"], earliest: float
    ) -> Float64[np.ndarray, " m"]:
        if self.windows is None:
            return dates
        low = self.windows.near(np.array([earliest]))
        found = self.windows.near(np.concatenate([dates, low]))
        return found[found >= earliest * (1.0 - 1e-12)]
