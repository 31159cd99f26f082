"""Like machines that are of another type: they tell nothing of this one, and are left out.

They began much nearer to the limit than this one did, so that their ages say nothing of its. Or
they came to its level by a course of another shape: half of the rise was done after a share of the
time until there that lies far from this one's.

>>> age = np.linspace(0.0, 10.0, 101)
>>> late = [Way(age, 10.0 * (age / life) ** 8 - 10.0, life) for life in (10.0, 10.5)]
>>> unlike(Way(age[:51], age[:51] - 10.0, np.nan), Fleet.of(late))
'they came to its level by a course of another shape'
"""

from __future__ import annotations

import numpy as np

from evertwin.prognosis.laws import Fleet, Indicator
from evertwin.prognosis.laws.way import Way, way_of

FEW = 5
"""Values that tell where a life begins."""
NEARER = 0.2
"""Share of the way to the limit by which they may have begun nearer to it."""
RISEN = 0.35
"""Share of the way from which the shape of a course is told."""
APART = 0.3
"""Share of the time by which its half way may lie beyond theirs."""


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
    begun = _begun(way)
    theirs = np.array([_begun(one) for one in ended])
    room = max(NEARER * abs(begun), 3.0 * float(np.std(theirs)))
    if float(np.median(theirs)) - begun > room:
        return "they began much nearer to the limit than it did"
    levels = [min(float(way.level[-1]), float(one.level[-1])) for one in ended]
    off = np.array([
        _half(one, level) - _half(way, level)
        for one, level in zip(ended, levels, strict=True)
        if level - begun > RISEN * abs(begun)
    ])  # fmt: skip
    if len(off) < 2 or not (np.all(off > APART) or np.all(off < -APART)):
        return ""
    return "they came to its level by a course of another shape"


def _begun(way: Way) -> float:
    return float(np.median(way.level[:FEW]))


def _half(one: Way, level: float) -> float:
    """Share of the time until a level after which half of the rise to it was done."""
    half, whole = (
        float(one.age[min(int(np.searchsorted(one.level, x)), len(one.age) - 1)] - one.age[0])
        for x in (0.5 * (level + _begun(one)), level)
    )
    return half / whole if whole > 0.0 else 1.0
