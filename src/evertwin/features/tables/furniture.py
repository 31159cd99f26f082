"""Tables while scans come: those of a room at each moment, in places of fixed number.

What `evertwin.features.tables.tables` makes of a whole recording is kept here in arrays of limited
length, scan by scan: legs, the views of late that tell whether beams went through, tables. A model
has a place for so many tables (`evertwin.models.tables.bodies`): each is in one for as long as it
stands somewhere, moved or not, and what a place holds changes only where a table came, went, or is
told to stand elsewhere by more than `CLOSER`.

>>> lidar = Lidar(0.0, 0.1, 9.0)
>>> room = Furnishing(lidar, 2)
>>> state, told = room.step(room.init(60), View(0, np.ones(60), lidar, np.zeros(3)))
>>> state.places.shape, told
((2, 6), [])
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from evertwin.features.scans.words import NEVER
from evertwin.features.tables.legs import Legs, View
from evertwin.features.tables.rectangles import Rectangle, corners
from evertwin.features.tables.tables import Happened, Room, Shape, Table, seen
from evertwin.models.tables.bodies import UNITS
from evertwin.sources.columns.scans import Lidar
from evertwin.types import Float64, Int64, Stamps

VIEWS = 200
"""Views that are kept: of the last 40 m, or of 400 s at rest."""
TABLES = 64
"""Tables that are known, and that are gone, at most; the newest."""
CLOSER = 0.01
"""By how much a corner is told better before what is told changes [m]."""
HALF = 1.96
"""Half of a 95 % interval, in standard deviations."""
WORDS = {
    "found": "stands {at}",
    "appeared": "appeared {at}, where nothing stood",
    "moved": "was moved by {way:.2f} m: it stood {was}, and stands {at}",
    "gone": "is gone: it stood {was}",
    "withdrawn": "is none: its legs {was} are another's",
}
"""What is said of what became of a table."""
UNKNOWN = "tables_unknown"
FURNISHED = (*(f"table_{what}" for what in WORDS), UNKNOWN)
"""Kinds of its events."""


class Told(NamedTuple):
    """What an event says.

    >>> Told("table_gone", "table 1 is gone", {}).kind
    'table_gone'
    """

    kind: str
    reason: str
    evidence: dict[str, Any]
    """``table`` (number); ``before``, ``now``: x, y [m], heading [rad], length, width around the
    legs [m]; ``half95``: half of the 95 % interval of each of those of ``now``, relative to the
    map."""


class Tables(NamedTuple):
    """Tables as arrays.

    >>> Tables.of(()).whole.shape
    (0, 10)
    """

    whole: Int64[np.ndarray, "k 10"]
    """Number, legs in turn, stamps since and seen [ns], looks, doubts, appeared."""
    shape: Float64[np.ndarray, "k 5"]
    covariance: Float64[np.ndarray, "k 5 5"]
    rest: Float64[np.ndarray, "k 2"]
    """Misfit; radius of the legs [m]."""

    @classmethod
    def of(cls, tables: Sequence[Table]) -> Tables:
        """The newest of ``tables``."""
        kept = tables[-TABLES:]
        whole = [
            (one.number, *one.rectangle.legs, one.since, one.seen, one.looks, one.doubts,
             int(one.appeared))
            for one in kept
        ]  # fmt: skip
        rest = [(one.rectangle.misfit, one.radius) for one in kept]
        return cls(
            np.array(whole, np.int64).reshape(-1, 10),
            np.array([one.rectangle.shape for one in kept], np.float64).reshape(-1, 5),
            np.array([one.rectangle.covariance for one in kept], np.float64).reshape(-1, 5, 5),
            np.array(rest, np.float64).reshape(-1, 2),
        )  # fmt: skip

    def each(self) -> Iterator[Table]:
        """One by one."""
        for k, (number, a, b, c, d, since, last, looks, doubts, new) in enumerate(
            self.whole.tolist()
        ):
            misfit, radius = self.rest[k].tolist()
            rectangle = Rectangle((a, b, c, d), self.shape[k], self.covariance[k], misfit)
            yield Table(number, rectangle, radius, since, last, looks, doubts, bool(new))


class Furniture(NamedTuple):
    """State of `Furnishing`.

    >>> Furnishing(Lidar(0.0, 0.1, 9.0), 2).init(60).ranges.shape
    (0, 60)
    """

    legs: Legs
    found: Tables
    gone: Tables
    t: Stamps
    """Of the views that are kept [ns]."""
    ranges: Float64[np.ndarray, "n beams"]
    pose: Float64[np.ndarray, "n 3"]
    """Of the lidar."""
    looked: int
    """Stamp of the newest look for rectangles [ns]."""
    last: int
    """Number of the newest table."""
    numbers: Int64[np.ndarray, " places"]
    """Of the table in each place; 0: none."""
    places: Float64[np.ndarray, "places 6"]
    """x, y [m], heading [rad], length, width around the legs, radius of these [m]; 0: none."""


@dataclass(frozen=True)
class Furnishing:
    """Goes from scan to scan. See the module for an example."""

    lidar: Lidar
    count: int
    """Places."""

    def init(self, beams: int) -> Furniture:
        """Nothing was seen yet."""
        none = Tables.of(())
        return Furniture(
            Legs.none(), none, none, np.zeros(0, np.int64), np.zeros((0, beams)), np.zeros((0, 3)),
            NEVER, 0, np.zeros(self.count, np.int64), np.zeros((self.count, len(UNITS))),
        )  # fmt: skip

    def step(self, state: Furniture, view: View) -> tuple[Furniture, list[Told]]:
        """The tables after one more scan, and what became known by it. Consumes ``state``."""
        kept = zip(state.t.tolist(), state.ranges, state.pose, strict=True)
        views = tuple(View(t, ranges, self.lidar, pose) for t, ranges, pose in kept)
        looked = None if state.looked == NEVER else state.looked
        found, gone = (tuple(some.each()) for some in (state.found, state.gone))
        room, happened = seen(Room(state.legs, found, gone, views, looked, state.last), view)
        if room.views[-1] is view:
            state = state._replace(
                t=np.append(state.t, view.t)[-VIEWS:],
                ranges=np.concatenate([state.ranges, view.ranges[None]])[-VIEWS:],
                pose=np.concatenate([state.pose, view.pose[None]])[-VIEWS:],
            )
        state = state._replace(legs=room.legs)
        if room.looked == looked:
            return state, []
        self._place(state, room.tables)
        told = [self._told(one, room.tables, state.numbers) for one in happened]
        state = state._replace(found=Tables.of(room.found), gone=Tables.of(room.gone))
        return state._replace(last=room.last, looked=view.t), told

    def _place(self, state: Furniture, tables: Sequence[Table]) -> None:
        """Tables into their places; one more than there are waits for a place."""
        there = {one.number: one for one in tables}
        left = ~np.isin(state.numbers, list(there))
        state.numbers[left], state.places[left] = 0, 0.0
        for number, table in there.items():
            [known] = np.nonzero(state.numbers == number)
            [free] = np.nonzero(state.numbers == 0)
            if not (len(known) or len(free)):
                continue
            k, now = (known if len(known) else free)[0], table.shape
            off = corners(now) - corners(state.places[k, :5])
            if not len(known) or np.hypot(*off.T).max() > CLOSER:
                state.numbers[k], state.places[k] = number, [*now, table.radius]

    def _told(self, one: Happened, tables: Sequence[Table], numbers: np.ndarray) -> Told:
        """What became of a table, as an event says it."""
        table = next((some for some in tables if some.number == one.number), None)
        half = None if table is None else HALF * np.sqrt(table.rectangle.covariance.diagonal())
        way = np.zeros(2) if one.before is None or one.now is None else (one.now - one.before)[:2]
        at, was = _where(one.now, half), _where(one.before, None)
        said = WORDS[one.what].format(at=at, was=was, way=float(np.hypot(*way)))
        if one.now is not None and one.number not in numbers:
            said += f"; all {self.count} places for tables are taken: the model does not have it"
        told = {"table": one.number, "before": one.before, "now": one.now, "half95": half}
        return Told(f"table_{one.what}", f"table {one.number} {said}", told)


def _where(shape: Shape | None, half: np.ndarray | None) -> str:
    if shape is None:
        return ""
    x, y = (f"{v:.2f}" + ("" if half is None else f" ± {h:.2f}")
            for v, h in zip(shape[:2], shape if half is None else half))  # fmt: skip
    return f"at x {x}, y {y} m"
