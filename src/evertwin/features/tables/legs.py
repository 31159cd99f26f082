"""Legs: spots that stay where they are, followed from scan to scan in the frame of the map.

Each leg has a place with its covariance and the evidence that it is there: log odds, up where a
spot is seen at it, down where a beam that should have met it went on. What hides behind something
keeps its odds. What moves, such as a person, loses them: the beams go on through where it was.

A scan taken where the one before was taken repeats its errors; it tells that a leg is still there,
and no more of where it stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.features.tables.spots import Spots, spots
from evertwin.sources.columns.scans import Lidar
from evertwin.types import Bools, Float64, Int64, Vector

SEEN, UNSEEN = 2.5, -1.35
"""Log odds of a spot at a leg (there: .6, none: .05), of a beam through it (.25, .97)."""
FIRST, SURE, MOST, GONE = 1.0, 5.0, 8.0, -2.0
"""Log odds of a new spot; from which on a leg is sure; at most; below which it is gone."""
FARTHEST = 6.0
"""Range up to which spots are taken for legs [m]."""
GATE, APART = 9.21, 0.15
"""How far a spot may be from its leg: squared, in its spread (99 %), and [m]."""
POSE = 0.02
"""Standard deviation of the lidar's place from scan to scan [m]."""
AGAIN, TURNED = 0.1, 0.1
"""Way [m] and turn [rad] after which a scan tells more of a leg's place."""
BEHIND = 0.15
"""By how much a beam that ends behind a leg went on [m]."""
CENTRAL = 0.6
"""Share of a leg's radius within which a beam should meet it."""
BESIDE = 3
"""Beams on either side of the middle one that are asked."""
CAPACITY = 500
"""Legs at once; the least sure ones go first."""


class Legs(NamedTuple):
    """Legs in the frame of the map.

    >>> Legs.none().place.shape
    (0, 2)
    """

    next: int
    """Number of the next leg."""
    number: Int64[np.ndarray, " k"]
    """Of each, for ever."""
    place: Float64[np.ndarray, "k 2"]
    """[m]"""
    covariance: Float64[np.ndarray, "k 2 2"]
    odds: Vector
    radius: Vector
    """[m]"""
    seen_from: Float64[np.ndarray, "k 3"]
    """The lidar's pose when it last told of the place."""
    born: Int64[np.ndarray, " k"]
    """Stamp of the first spot [ns]."""
    seen: Int64[np.ndarray, " k"]
    """Of the newest."""

    @classmethod
    def none(cls) -> Legs:
        """Before the first scan."""
        whole, zeros = np.zeros(0, np.int64), np.zeros(0)
        places, poses = np.zeros((0, 2)), np.zeros((0, 3))
        return cls(0, whole, places, np.zeros((0, 2, 2)), zeros, zeros, poses, whole, whole)

    def kept(self, chosen: Bools | Int64[np.ndarray, " m"]) -> Legs:
        """Some of them."""
        return Legs(self.next, *(one[chosen] for one in self[1:]))


class View(NamedTuple):
    """A scan and where it was taken.

    >>> View(0, np.ones(4), Lidar(0.0, 0.1, 9.0), np.zeros(3)).turn.tolist()
    [[1.0, -0.0], [0.0, 1.0]]
    """

    t: int
    ranges: Vector
    lidar: Lidar
    pose: Float64[np.ndarray, " 3"]

    @property
    def turn(self) -> Float64[np.ndarray, "2 2"]:
        """From the lidar's frame into the map's."""
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        return np.array([[c, -s], [s, c]])


def gone_through(place: Float64[np.ndarray, "k 2"], radius: Vector, view: View) -> Bools:
    """Which legs beams went through: nothing is there.

    Of a beam without return nothing is known but that it went on.
    """
    if not len(place):
        return np.zeros(0, dtype=np.bool_)
    at = (place - view.pose[:2]) @ view.turn
    r, lidar = np.hypot(at[:, 0], at[:, 1]), view.lidar
    turn = (np.arctan2(at[:, 1], at[:, 0]) - lidar.start) / lidar.step
    circle = 2 * np.pi / abs(lidar.step)
    middle = np.rint(turn % circle)
    beams = middle[:, None] + np.arange(-BESIDE, BESIDE + 1)
    off = np.abs((turn[:, None] - beams + 0.5 * circle) % circle - 0.5 * circle)
    beams = (beams % round(circle)).astype(np.int64)
    meets = off * abs(lidar.step) * r[:, None] < CENTRAL * radius[:, None]
    meets &= beams < len(view.ranges)
    ranges = view.ranges[np.minimum(beams, len(view.ranges) - 1)]
    through = np.isnan(ranges) | (ranges > r[:, None] + BEHIND)
    near = (r < FARTHEST) & (r > 0.05)
    return np.asarray(near & (meets & through).any(axis=1) & ~(meets & ~through).any(axis=1))


def followed_legs(legs: Legs, view: View) -> Legs:
    """The legs after one more scan."""
    found = spots(view.ranges, view.lidar)
    near = np.hypot(found.place[:, 0], found.place[:, 1]) < FARTHEST
    found = Spots(*(one[near] for one in found))
    place = found.place @ view.turn.T + view.pose[:2]
    spread = view.turn @ found.covariance @ view.turn.T + POSE * POSE * np.eye(2)
    mine = _matched(legs, place, spread)
    legs = _updated(legs, (place, spread, found.radius), mine, view)
    through = gone_through(legs.place, legs.radius, view)
    through[mine[mine >= 0]] = False
    legs = legs._replace(odds=np.where(through, legs.odds + UNSEEN, legs.odds))
    legs = legs.kept(legs.odds > GONE)
    new = mine < 0
    n = int(new.sum())
    stamps = np.full(n, view.t)
    born = Legs(
        0, legs.next + np.arange(n), place[new], spread[new], np.full(n, FIRST), found.radius[new],
        np.tile(view.pose, (n, 1)), stamps, stamps,
    )  # fmt: skip
    both = Legs(legs.next + n, *(np.concatenate(pair) for pair in zip(legs[1:], born[1:])))
    if len(both.odds) > CAPACITY:
        both = both.kept(np.sort(np.argsort(-both.odds, kind="stable")[:CAPACITY]))
    return both


def _matched(
    legs: Legs, place: Float64[np.ndarray, "m 2"], spread: Float64[np.ndarray, "m 2 2"]
) -> Int64[np.ndarray, " m"]:
    """For each spot the leg that it is, or -1; the nearest pairs first."""
    mine = np.full(len(place), -1, dtype=np.int64)
    if not len(place) or not len(legs.place):
        return mine
    off = place[:, None] - legs.place[None]
    total = spread[:, None] + legs.covariance[None]
    far = np.einsum("mki,mkij,mkj->mk", off, np.linalg.inv(total), off)
    far = np.where(np.hypot(off[..., 0], off[..., 1]) < APART, far, np.inf)
    for _ in range(len(place)):
        i, k = np.unravel_index(int(np.argmin(far)), far.shape)
        if not far[i, k] < GATE:
            break
        mine[i] = k
        far[i], far[:, k] = np.inf, np.inf
    return mine


def _updated(
    legs: Legs, seen: Sequence[np.ndarray], mine: Int64[np.ndarray, " m"], view: View
) -> Legs:
    """The legs that spots were seen at: surer, and by a new place surer of theirs."""
    place, spread, radius = (one[mine >= 0] for one in seen)
    k = mine[mine >= 0]
    odds, last = legs.odds.copy(), legs.seen.copy()
    odds[k], last[k] = np.minimum(odds[k] + SEEN, MOST), view.t
    moved = view.pose - legs.seen_from[k]
    new = (np.hypot(moved[:, 0], moved[:, 1]) > AGAIN) | (np.abs(moved[:, 2]) > TURNED)
    k, place, spread, radius = k[new], place[new], spread[new], radius[new]
    at, covariance, size = legs.place.copy(), legs.covariance.copy(), legs.radius.copy()
    seen_from = legs.seen_from.copy()
    gain = covariance[k] @ np.linalg.inv(covariance[k] + spread)
    at[k] += (gain @ (place - at[k])[..., None])[..., 0]
    covariance[k] -= gain @ covariance[k]
    size[k] += 0.2 * (radius - size[k])
    seen_from[k] = view.pose
    return legs._replace(
        place=at, covariance=covariance, odds=odds, radius=size, seen_from=seen_from, seen=last
    )
