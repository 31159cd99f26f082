"""Tables from scans: what stands on four legs, where it is, how large, and when it was moved.

A lidar below the plate sees a table as four spots. Spots that stay are legs; legs at the corners of
a rectangle are a table, if beams go through between them: a solid box is none. A table is believed
when the same rectangle was found twice in a row, and gone when beams went through where its legs
were.

A table that is found where beams had gone through before has *appeared*. If one of the same size is
gone from elsewhere it is that one, *moved*, which is said as soon as both places were seen.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from evertwin.features.tables.legs import SURE, Legs, View, followed_legs, gone_through
from evertwin.features.tables.rectangles import Rectangle, apart, candidates, corners, explained
from evertwin.types import Float64

EVERY = 500_000_000
"""Time between looks for rectangles [ns]."""
LATELY = 2_000_000_000
"""A rectangle is new only while one of its legs was seen as lately as that [ns]."""
VIEW_WAY, VIEW_TURN, VIEW_TIME = 0.2, 0.2, 2_000_000_000
"""Way [m], turn [rad] or time [ns] after which a view is kept."""
VIEWS, ASKED = 2_000, 40
"""Views that are kept, and that are asked whether beams went through: the newest."""
GRID, MARGIN = 0.1, 0.12
"""Distance of the points between the legs that beams should pass, and theirs from the legs [m]."""
OPEN, TWICE = 0.5, 2
"""Share of these points that beams must pass, each in so many views."""
EMPTY = 4
"""Views through a leg's place that say that nothing stood there."""
BIRTH, DOUBTS = 2, 6
"""Looks in a row that make a table; that find its legs to be another's."""
ALIKE, SIGMAS = 0.04, 3.0
"""How far sizes of one table may differ: [m], and in their spread."""
SAME = 0.1
"""How far a table may seem to go from look to look, and either end of its sides [m]."""

Shape = Float64[np.ndarray, " 5"]
"""x, y [m], heading [rad], length, width [m] around the legs."""


class Table(NamedTuple):
    """A table, as far as it is known.

    >>> Table._fields[:3]
    ('number', 'rectangle', 'radius')
    """

    number: int
    """0 until it is believed."""
    rectangle: Rectangle
    radius: float
    """Of its legs, on average [m]."""
    since: int
    """Stamp of the first spot at its legs [ns]."""
    seen: int
    """Of the newest."""
    looks: int
    """In a row that found it."""
    doubts: int
    """In a row that did not."""
    appeared: bool
    """Beams had gone through its place before."""

    @property
    def shape(self) -> Shape:
        """Around its legs."""
        return np.asarray(self.rectangle.shape + 2 * self.radius * np.array([0, 0, 0, 1, 1]))


class Happened(NamedTuple):
    """What became of a table.

    >>> Happened(0, "found", 1, None, None).what
    'found'
    """

    t: int
    """When it became known [ns]."""
    what: str
    """``found``, ``appeared`` (where nothing stood), ``gone``, ``moved``, ``withdrawn`` (its legs
    are another's)."""
    number: int
    before: Shape | None
    now: Shape | None


@dataclass(frozen=True)
class Room:
    """Everything that is known at a time.

    >>> Room().tables
    ()
    """

    legs: Legs = field(default_factory=Legs.none)
    found: tuple[Table, ...] = ()
    gone: tuple[Table, ...] = ()
    """That stand there no more, and were not found elsewhere."""
    views: tuple[View, ...] = ()
    looked: int | None = None
    """Stamp of the newest look for rectangles [ns]."""
    last: int = 0
    """Number of the newest table."""
    three: bool = False
    """Are three legs a table whose fourth was never in sight?"""

    @property
    def tables(self) -> tuple[Table, ...]:
        """That stand there."""
        return tuple(one for one in self.found if one.number)


def furnished(views: Iterable[View], three: bool = False) -> tuple[Room, tuple[Happened, ...]]:
    """The tables of a room that is seen by ``views``, in the order of time."""
    room, happened = Room(three=three), list[Happened]()
    for view in views:
        room, more = seen(room, view)
        happened += more
    return room, tuple(happened)


def seen(room: Room, view: View) -> tuple[Room, list[Happened]]:
    """The room after one more scan, and what became known by it."""
    views = room.views
    if not views or _tells_more(views[-1], view):
        views = (*views, view)[-VIEWS:]
    room = replace(room, legs=followed_legs(room.legs, view), views=views)
    if room.looked is not None and view.t - room.looked < EVERY:
        return room, []
    return _looked(replace(room, looked=view.t), view.t)


def _tells_more(before: View, now: View) -> bool:
    way = now.pose - before.pose
    moved = np.hypot(way[0], way[1]) > VIEW_WAY or abs(way[2]) > VIEW_TURN
    return bool(moved or now.t - before.t > VIEW_TIME)


def _looked(room: Room, t: int) -> tuple[Room, list[Happened]]:
    """Looks for rectangles, and at what became of the tables that were known."""
    sure = room.legs.kept(room.legs.odds >= SURE)
    left = explained([one for one in candidates(sure, 4) if _is_table(one, room, t)])
    if room.three:
        used = frozenset[int]().union(*(one.known for one in left))
        rest = sure.kept(~np.isin(sure.number, list(used)))
        hidden = [one for one in candidates(rest, 3) if _is_table(one, room, t)]
        left += [one for one in explained(hidden) if all(apart(one, other) for other in left)]
    happened, found, gone, last = list[Happened](), list[Table](), list(room.gone), room.last
    for table in room.found:
        same = next((one for one in left if _same(one, table, sure)), None)
        if same is not None:
            left.remove(same)
            table = _at(same, sure, table)
            if not table.number and table.looks >= BIRTH:
                last += 1
                table = table._replace(number=last, appeared=_was_empty(table, room))
                what = "appeared" if table.appeared else "found"
                happened.append(Happened(t, what, last, None, table.shape))
            found.append(table)
        elif table.number:
            table = table._replace(doubts=table.doubts + 1)
            standing = np.isin(list(table.rectangle.known), room.legs.number).sum() >= 3
            if standing and table.doubts < DOUBTS:
                found.append(table)
                continue
            gone.append(table)
            what = "withdrawn" if standing else "gone"
            happened.append(Happened(t, what, table.number, table.shape, None))
    found += [_at(one, sure, None) for one in left]
    return _moves(replace(room, found=tuple(found), gone=tuple(gone), last=last), t, happened)


def _at(one: Rectangle, legs: Legs, before: Table | None) -> Table:
    """A table found once more, or for the first time."""
    mine = np.isin(legs.number, list(one.known))
    radius, newest = float(legs.radius[mine].mean()), int(np.median(legs.seen[mine]))
    if before is None:
        return Table(0, one, radius, int(np.median(legs.born[mine])), newest, 1, 0, False)
    return before._replace(rectangle=one, radius=radius, seen=newest, looks=before.looks + 1,
                           doubts=0)  # fmt: skip


def _same(one: Rectangle, table: Table, legs: Legs) -> bool:
    """Is it the table that was known, where it was?"""
    before = table.rectangle
    way = np.hypot(*(one.shape[:2] - before.shape[:2]))
    if len(one.known & before.known) >= 3:
        return True
    # of touching tables now this leg, now that one beside it is taken for a corner
    stands = np.isin(list(before.known), legs.number).all()
    near = stands and np.abs(one.shape[3:] - before.shape[3:]).max() < 2 * SAME
    return bool(way < SAME and (near or _alike(one, before)))


def _alike(one: Rectangle, other: Rectangle) -> bool:
    """Are both of one size?"""
    off = np.abs(one.shape[3:] - other.shape[3:])
    spread = np.sqrt((one.covariance + other.covariance).diagonal()[3:])
    return bool((off < np.maximum(ALIKE, SIGMAS * spread)).all())


def _is_table(one: Rectangle, room: Room, t: int) -> bool:
    """Do beams go through between its legs, and past a corner that no leg is seen at?"""
    if any(one.known == table.rectangle.known and table.number for table in room.found):
        return True
    mine = np.isin(room.legs.number, list(one.known))
    if t - room.legs.seen[mine].max() > LATELY:
        return False
    since = int(np.median(room.legs.born[mine]))
    views = [view for view in room.views if view.t >= since][-ASKED:]
    points = _inside(one.shape)
    hidden = one.corners()[[k for k, leg in enumerate(one.legs) if leg < 0]]
    both = np.concatenate([points, hidden])
    passed = np.zeros(len(both), dtype=np.int64)
    for view in views:
        passed += gone_through(both, np.full(len(both), 0.5 * GRID), view)
    empty = passed >= TWICE
    return bool(empty[: len(points)].mean() >= OPEN and not empty[len(points) :].any())


def _inside(shape: Shape) -> Float64[np.ndarray, "m 2"]:
    """Points between the legs."""
    half = np.maximum(0.5 * shape[3:] - MARGIN, 0.0)
    rows, columns = (np.linspace(-one, one, 1 + int(2 * one / GRID)) for one in half)
    own = np.stack(np.meshgrid(rows, columns), axis=-1).reshape(-1, 2)
    c, s = np.cos(shape[2]), np.sin(shape[2])
    return np.asarray(shape[:2] + own @ np.array([[c, s], [-s, c]]))


def _was_empty(table: Table, room: Room) -> bool:
    """Had beams gone through where its legs stand, before they did?"""
    places = corners(table.rectangle.shape)
    passed = np.zeros(4, dtype=np.int64)
    for view in room.views:
        if view.t < table.since:
            passed += gone_through(places, np.full(4, table.radius), view)
    return bool((passed >= EMPTY).sum() >= 3)


def _moves(room: Room, t: int, happened: list[Happened]) -> tuple[Room, list[Happened]]:
    """Puts together what is gone and what has appeared, if they are alike."""
    found, gone = list(room.found), list(room.gone)
    for k, table in enumerate(found):
        if not (table.number and table.appeared):
            continue
        earlier = (one for one in gone if one.seen <= table.since + LATELY)
        alike = [one for one in earlier if _alike(one.rectangle, table.rectangle)]
        if alike:
            before = max(alike, key=lambda one: one.seen)
            gone.remove(before)
            both = (before.number, table.number)  # what is said of it now says all
            happened = [one for one in happened if one.number not in both]
            happened.append(Happened(t, "moved", before.number, before.shape, table.shape))
            found[k] = table._replace(number=before.number, appeared=False)
    return replace(room, found=tuple(found), gone=tuple(gone)), happened
