"""Compiled: a few rows of what goes steadily as a position does, that cannot be its own.

What it does from one row to the next is compared with the fastest that it ever did. Rows that leave
it far faster and come back as fast are wrong: they are taken from their neighbours. Where it goes
on from there as it ever went, its zero moved; where it stood still before, and moves at once, it
was frozen, and is back; where place and speed are so many times what they were, its unit changed: a
number that divides two units is undone, and the row known as such, until it is back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.signals import mistaken
from evertwin.types import Vector

if TYPE_CHECKING:
    from evertwin.sync.alignment.derive_loop import Lines

KNOWN, FAR, NEAR, LONGEST = 50, 4.0, 1.5, 3
"""Of what goes steadily: rows at which it moved before it is known how fast it does, times of that
from which a step is none of its own, times within which it is back, and rows that may be wrong."""
LEAPT, BACK, RESCALED, OTHER = 7, 8, 9, 10
"""Mark of a row up to which what goes steadily leapt; at which it is back; from which on it is in
another unit, and of the rows since."""
TWICE, EXACT, CLEARLY, SLOW, MOST, WENT, NEARER = 2.0, 0.1, 0.3, 0.02, 0.5, 5.0, 0.7
"""Times that two units differ at least; share by which what is back is; part of the fastest speed,
and of the change of speed that a moved zero leaves, that another unit leaves at most; part of the
fastest below which it stands; of where it ever was, what it goes over once it is back; times the
way of a row at its fastest that it went to and fro at least before a unit is told; and part of how
far its speed is from what it was that another unit leaves at most."""
MOVED, FASTEST, WRONG, ZERO, FOR, NUMBER, LOWEST, HIGHEST, LOW, HIGH = range(10)
"""Places of ``sums``: rows at which it moved, the fastest, rows that are wrong yet, what its zero
moved by, for how long it stands or is no larger than it was, how many times it is what it was;
lowest and highest place, and those since it last was beyond them or went faster than ever."""
AGAIN = 10.0
"""Seconds for which what was so many times as large is no more so once it is back."""
DEGREES, SAME = 57.29577951308232, 1e-3
"""Of a radian, and the share by which a place is known."""
UNITS = np.array([
    one.number for one in mistaken.FACTORS
    if not one.units or {"m", "rad"} & set(one.units)
])  # fmt: skip
"""Numbers that divide two units of a place."""
OK, ERROR = 0, 6


@njit(cache=True, error_model="numpy")
def of_units(number: float) -> float:
    """The number of two units that it is; 1: of none."""
    found, least = 1.0, EXACT
    for one in UNITS:
        for known in (one, 1.0 / one):
            off = abs(number / known - 1.0)
            if off < least:
                found, least = known, off
    return found


@njit(cache=True, error_model="numpy")
def in_units(value: float, expected: float, came: float, goes: float, way: float) -> float:
    """The number of two units between a place and what was ``expected`` of it, that its speed says
    too, or that is exact; 0: there is none. ``way``: of a row, as far as it may be from there."""
    found, least = 0.0, 0.5
    for one in UNITS:
        for known in (one, 1.0 / one):
            off = abs(value / known - expected) / way
            nearer = abs(goes - known * came) < NEARER * abs(goes - came)
            if off < least and (nearer or off < SLOW):
                found, least = known, off
    return found


@njit(cache=True, error_model="numpy")
def speed(ring: Lines, i: int, from_: float, j: int, to: float) -> float:
    """From a value at place i to one at place j; NaN without an interval."""
    passed = (ring.t[j] - ring.t[i]) * 1e-9
    return (to - from_) / passed if passed > 0.0 else np.nan


@njit(cache=True, error_model="numpy")
def astray(ring: Lines, at: int, c: int, last: float, rows: int, fastest: float) -> int:
    """Rows from place ``at`` on that leave what was before far faster than it ever went, and come
    back as fast; −1: it goes on from there as it ever went; 0: neither.

    Args:
        last: the value before.
        rows: that are known from ``at`` on.
    """
    depth = ring.t.shape[0]
    before = (at - 1) % depth
    away = speed(ring, before, last, at, ring.v[at, c])
    if not abs(away) > FAR * fastest:
        return 0
    on = 0
    for m in range(1, min(LONGEST, rows - 1) + 1):
        end, behind = (at + m - 1) % depth, (at + m) % depth
        back = speed(ring, end, ring.v[end, c], behind, ring.v[behind, c])
        whole = speed(ring, before, last, behind, ring.v[behind, c])
        if back * away < 0.0 and abs(back) > FAR * fastest and abs(whole) <= NEAR * fastest:
            return m
        on += abs(back) <= NEAR * fastest
    return -1 if on == LONGEST else 0


@njit(cache=True, error_model="numpy")
def thaws(ring: Lines, at: int, c: int, leap: float, most: float) -> bool:
    """Did a ``leap`` to place ``at`` go no farther than ``most``, as far as it can have gone while
    it stood, and does it go on one way at each row from there?"""
    depth = ring.t.shape[0]
    way = ring.v[(at + 1) % depth, c] - ring.v[at, c]
    for m in range(at, at + LONGEST):
        if not way * (ring.v[(m + 1) % depth, c] - ring.v[m % depth, c]) > 0.0:
            return False
    return abs(leap) <= most


@njit(cache=True, error_model="numpy")
def rescaled(
    ring: Lines, at: int, c: int, own: int, last: float, known: tuple[float, float]
) -> float:
    """How many times place and speed at place ``at`` are what they were, where it leapt there and
    the number is the same; 0: it is not.

    Args:
        own: column that tells of the rows before; see `astray`.
        known: the fastest that it ever went, and how many times it already is what it was (0:
            once). Of what is back the place is enough, or a speed far above those since.
    """
    depth, (fastest, since) = ring.t.shape[0], known
    before, first, end = (at - 1) % depth, (at - 1 - LONGEST) % depth, (at + LONGEST) % depth
    if since != 0.0:  # compared as recorded
        own, last = c, ring.v[before, c]
    away = abs(speed(ring, before, last, at, ring.v[at, c]))
    if 0.0 < abs(since) < 1.0 and away > FAR * abs(since) * fastest:
        return 1.0 / since
    if not away > FAR * fastest:
        return 0.0
    came = speed(ring, first, ring.v[first, own], before, ring.v[before, own])
    goes = speed(ring, at, ring.v[at, c], end, ring.v[end, c])
    passed = (ring.t[at] - ring.t[before]) * 1e-9
    number = ring.v[at, c] / (last + came * passed)
    if since != 0.0:  # what crosses zero may be any number of times what it was
        slow = abs(since) <= 1.0 or abs(goes) <= NEAR * fastest
        return number if slow and abs(number * since - 1.0) < EXACT else 0.0
    if abs(came) + abs(goes) <= SLOW * fastest:  # of what stands the place has to say it all
        unit = min(abs(number * DEGREES - 1.0), abs(number / DEGREES - 1.0)) < SAME
        return number if unit else 0.0
    named = in_units(ring.v[at, c], ring.v[at, c] / number, came, goes, passed * fastest)
    if named != 0.0:
        return float(named)
    off = abs(goes - number * came)
    near = off <= CLEARLY * min(abs(number) * fastest, abs(goes - came))
    return number if near and not 1.0 / TWICE < number < TWICE else 0.0


@njit(cache=True, error_model="numpy")
def is_its_own(ring: Lines, at: int, c: int, sums: Vector) -> bool:
    """Did what is larger than it was go over most of where it ever was, as recorded, no faster than
    ever, and not far beyond? Where place and noise are alike, its return is no leap."""
    if not abs(sums[NUMBER]) > 1.0:
        return False
    before, value = (at - 1) % ring.t.shape[0], ring.v[at, c]
    went = abs(speed(ring, before, ring.v[before, c], at, value))
    beyond = MOST * (sums[HIGHEST] - sums[LOWEST])
    if went > NEAR * sums[FASTEST] or not sums[LOWEST] - beyond <= value <= sums[HIGHEST] + beyond:
        sums[FOR], sums[LOW], sums[HIGH] = 0.0, value, value
    sums[FOR] += (ring.t[at] - ring.t[before]) * 1e-9
    sums[LOW], sums[HIGH] = min(sums[LOW], value), max(sums[HIGH], value)
    return bool(
        sums[FOR] >= AGAIN and sums[HIGH] - sums[LOW] >= MOST * (sums[HIGHEST] - sums[LOWEST])
    )


@njit(cache=True, error_model="numpy")
def steadily(
    ring: Lines, base: int, c: int, own: int, j: int, n: int, sums: Vector, only: bool
) -> tuple[float, int]:
    """What goes steadily at row j of n, and its mark: `ERROR` where it is taken from its
    neighbours; column ``own`` has what was told of the rows before.

    ``only``: its unit is looked at, and nothing else, as a recorded speed tells the rest.
    """
    depth = ring.t.shape[0]
    at, before = (base + j) % depth, (base + j - 1) % depth
    value = ring.v[at, c]
    if j == 0:
        sums[WRONG : FOR + 1], sums[LOW], sums[HIGH] = 0.0, value, value
        undone = of_units(sums[NUMBER]) if sums[NUMBER] != 0.0 else 1.0
        return value / undone, OTHER if undone != 1.0 else OK
    last, passed = ring.v[before, own] + sums[ZERO], (ring.t[at] - ring.t[before]) * 1e-9
    if sums[WRONG] == 0.0 and sums[MOVED] >= KNOWN:
        rows = 0
        if sums[NUMBER] == 0.0:
            rows = astray(ring, at, c, last, n - j, sums[FASTEST])
        went = sums[HIGHEST] - sums[LOWEST] >= WENT * sums[FASTEST] * passed
        if rows <= 0 and LONGEST < j < n - LONGEST and (went or sums[NUMBER] != 0.0):
            number = rescaled(ring, at, c, own, last, (sums[FASTEST], sums[NUMBER]))
            if number != 0.0 or is_its_own(ring, at, c, sums):
                mark = RESCALED if sums[NUMBER] == 0.0 else BACK
                sums[ZERO], sums[NUMBER] = 0.0, number if mark == RESCALED else 0.0
                sums[FOR], sums[LOW], sums[HIGH] = 0.0, value, value
                return value / (of_units(number) if mark == RESCALED else 1.0), mark
        if sums[NUMBER] != 0.0:
            undone = of_units(sums[NUMBER])
            return value / undone, OTHER if undone != 1.0 else OK  # else the twin asks what it is
        if only:
            rows = 0
        most = NEAR * sums[FASTEST] * (sums[FOR] + passed)
        if rows < 0 and sums[FOR] > 0.0 and thaws(ring, at, c, value - last, most):
            sums[FOR] = 0.0
            return value - sums[ZERO], BACK
        if rows < 0:
            behind = (at + 1) % depth
            went = last + speed(ring, at, value, behind, ring.v[behind, c]) * passed
            sums[ZERO] += value - went
            return value - sums[ZERO], LEAPT
        sums[WRONG] = rows
    if sums[WRONG] > 0.0:
        behind = (at + int(sums[WRONG])) % depth
        sums[WRONG] -= 1.0
        slope = speed(ring, before, last, behind, ring.v[behind, c])
        return last + slope * passed - sums[ZERO], ERROR
    went = abs(speed(ring, before, last, at, value))
    sums[FOR] = sums[FOR] + passed if went == 0.0 else 0.0
    if went > 0.0 and went < np.inf:
        sums[FASTEST] = max(
            sums[FASTEST], went if sums[MOVED] < KNOWN else min(went, 2.0 * sums[FASTEST])
        )
        goes = value - sums[ZERO]
        sums[LOWEST] = min(sums[LOWEST], goes) if sums[MOVED] > 0.0 else goes
        sums[HIGHEST] = max(sums[HIGHEST], goes) if sums[MOVED] > 0.0 else goes
        sums[MOVED] += 1.0
    return value - sums[ZERO], OK
