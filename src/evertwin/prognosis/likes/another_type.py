"""Like machines that are of another type: they tell nothing of this one, and are left out.

They began much nearer to the limit than this one did, so that their ages say nothing of its. Or
they came to its level by a course of another form (`evertwin.prognosis.laws.likes.likeness`), more
probably than not.

>>> age = np.linspace(0.0, 10.0, 101)
>>> late = [Way(age, 10.0 * (age / life) ** 8 - 10.0, life) for life in (10.0, 10.5)]
>>> unlike(Way(age[:51], age[:51] - 10.0, np.nan), Fleet.of(late))
'they came to its level by a course of another shape'
"""

from __future__ import annotations

import numpy as np

from evertwin.prognosis.laws import Fleet, Indicator
from evertwin.prognosis.laws.growth.way import Way, way_of
from evertwin.prognosis.laws.likes.likeness import begun

NEARER = 0.2
"""Share of the way to the limit by which they may have begun nearer to it."""
MOST = 0.5
"""Chance of another form from which they are left out."""


def of_its_type(own: Indicator, fleet: Fleet | None) -> tuple[Fleet | None, tuple[str, ...]]:
    """The fleet, or none with a note, where it is of another type than a machine."""
    way = None if fleet is None else way_of(own)
    if fleet is None or way is None:
        return fleet, ()
    why = unlike(way, fleet)
    if not why:
        return fleet, ()
    note = f"its like machines are left out, {why}: are they of its type? Its life is told alone"
    return None, (f"{own.name}: {note}",)


def unlike(way: Way, fleet: Fleet) -> str:
    """Why a fleet tells nothing of a machine; empty where it does."""
    ended = [one for one in fleet.ways if np.isfinite(one.end)]
    first = begun(way)
    theirs = np.array([begun(one) for one in ended])
    room = max(NEARER * abs(first), 3.0 * float(np.std(theirs)))
    if float(np.median(theirs)) - first > room:
        return "they began much nearer to the limit than it did"
    return "they came to its level by a course of another shape" if fleet.other(way) > MOST else ""
