"""Rectangles with legs at their corners: four legs, or three where the fourth cannot be seen.

A rectangle has a middle c, a heading φ, a length l and a width w. Its corners are
c + R(φ)·(±l, ±w)/2; the five numbers follow from the legs by weighted least squares, with their
covariance. What the legs are off then, in their own spread, says whether they are a rectangle.

The same legs may be the corners of several rectangles: of a table, of the aisle between two tables,
of two tables as one. Of all ways to explain the legs the one is taken that explains most of them
with the fewest rectangles, none of which lies on another.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from evertwin.features.tables.legs import Legs
from evertwin.types import Float64

SHORTEST, LONGEST = 0.45, 2.6
"""Distance of neighbouring legs of a table [m]: nearer ones are a chair's."""
ANGLE = 0.1
"""How far off a right angle three legs may be to be tried, as a cosine."""
NEAR = 0.1
"""How far from its corner a fourth leg may stand to be tried [m]."""
CROOKED = 0.01
"""Standard deviation of where a table's legs stand, against a rectangle [m]."""
FITS = {3: 7.879438576622419, 4: 12.83815646659865}
"""Largest misfit, by the legs that are seen: of 0.995 of all rectangles it is less."""
COST, UNSEEN_CORNER = 1.5, 0.4
"""Of a rectangle, in legs that it explains; of a corner that cannot be seen."""
OVERLAP = 0.08
"""By how much tables may seem to lie on each other [m]."""
MOST = 10
"""Rectangles on common legs of which all ways are tried; of more the best is taken first."""
SIGNS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


class Rectangle(NamedTuple):
    """Legs as a rectangle.

    >>> Rectangle._fields[:2]
    ('legs', 'shape')
    """

    legs: tuple[int, ...]
    """Numbers of the legs at its corners in turn; -1: cannot be seen."""
    shape: Float64[np.ndarray, " 5"]
    """x, y [m], heading [rad, of the longer side, in -π/2 … π/2], length, width [m] from leg to
    leg."""
    covariance: Float64[np.ndarray, "5 5"]
    misfit: float
    """Squared, in standard deviations."""

    @property
    def known(self) -> frozenset[int]:
        """Legs that are seen."""
        return frozenset(leg for leg in self.legs if leg >= 0)

    def corners(self, shrunk: float = 0.0) -> Float64[np.ndarray, "4 2"]:
        """In turn, each side shorter by ``shrunk`` [m]."""
        return corners(self.shape - [0, 0, 0, shrunk, shrunk])


def corners(shape: Float64[np.ndarray, " 5"]) -> Float64[np.ndarray, "4 2"]:
    """Corners of a shape, in turn.

    >>> corners(np.array([1.0, 0.0, np.pi / 2, 2.0, 1.0])).round(3).tolist()
    [[0.5, 1.0], [0.5, -1.0], [1.5, -1.0], [1.5, 1.0]]
    """
    c, s = np.cos(shape[2]), np.sin(shape[2])
    return np.asarray(shape[:2] + 0.5 * SIGNS * shape[3:] @ np.array([[c, s], [-s, c]]))


def fitted(legs: Legs, turn: Sequence[int]) -> Rectangle | None:
    """The rectangle whose corners are the legs ``turn`` (places in ``legs``, -1: unseen).

    None where they are no rectangle.
    """
    seen = np.array([k for k, leg in enumerate(turn) if leg >= 0])
    at = np.array([turn[k] for k in seen])
    place, signs = legs.place[at], SIGNS[seen]
    weight = np.linalg.inv(legs.covariance[at] + CROOKED * CROOKED * np.eye(2))
    shape = _begun(place, signs)
    for _ in range(4):
        c, s = np.cos(shape[2]), np.sin(shape[2])
        own = 0.5 * signs * shape[3:]
        jacobian = np.zeros((len(seen), 2, 5))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
        jacobian[:, 0, 2] = -s * own[:, 0] - c * own[:, 1]
        jacobian[:, 1, 2] = c * own[:, 0] - s * own[:, 1]
        jacobian[:, 0, 3], jacobian[:, 1, 3] = 0.5 * c * signs[:, 0], 0.5 * s * signs[:, 0]
        jacobian[:, 0, 4], jacobian[:, 1, 4] = -0.5 * s * signs[:, 1], 0.5 * c * signs[:, 1]
        off = place - shape[:2] - own @ np.array([[c, s], [-s, c]])
        normal = np.einsum("kia,kij,kjb->ab", jacobian, weight, jacobian)
        shape = shape + np.linalg.solve(normal, np.einsum("kia,kij,kj->a", jacobian, weight, off))
    misfit = float(np.einsum("ki,kij,kj->", off, weight, off))
    if misfit > FITS[len(seen)] or shape[3:].min() < SHORTEST:
        return None
    covariance = np.linalg.inv(normal)
    numbers = [int(legs.number[leg]) if leg >= 0 else -1 for leg in turn]
    if shape[4] > shape[3]:  # the longer side is its length
        shape = shape[[0, 1, 2, 4, 3]] + [0, 0, 0.5 * np.pi, 0, 0]
        covariance = covariance[np.ix_([0, 1, 2, 4, 3], [0, 1, 2, 4, 3])]
        numbers = [*numbers[1:], numbers[0]]
    if not -0.5 * np.pi <= shape[2] < 0.5 * np.pi:
        half = round(shape[2] / np.pi)
        shape[2] -= half * np.pi
        numbers = numbers if half % 2 == 0 else [*numbers[2:], *numbers[:2]]
    return Rectangle(tuple(numbers), shape, covariance, misfit)


def _begun(place: Float64[np.ndarray, "m 2"], signs: Float64[np.ndarray, "m 2"]) -> np.ndarray:
    """A shape near the legs: the affine map from corners to legs, made square."""
    found, *_ = np.linalg.lstsq(np.column_stack([np.ones(len(signs)), signs]), place, rcond=None)
    middle, along, across = found
    heading = np.arctan2(along[1] - across[0], along[0] + across[1])
    return np.array([*middle, heading, 2 * np.hypot(*along), 2 * np.hypot(*across)])


def candidates(legs: Legs, corners_seen: int) -> list[Rectangle]:
    """Every rectangle that the legs may be corners of: four of them, or three and none near the
    fourth corner."""
    place, found = legs.place, dict[frozenset[int], Rectangle]()
    off = place[None] - place[:, None]
    apart = np.hypot(off[..., 0], off[..., 1])
    for i in range(len(place)):
        near = np.flatnonzero((apart[i] > SHORTEST) & (apart[i] < LONGEST))
        along = off[i, near] / apart[i, near, None]
        square = np.argwhere(np.triu(np.abs(along @ along.T) < ANGLE, 1))
        for a, b in near[square].tolist():
            turns_left = off[i, a, 0] * off[i, b, 1] > off[i, a, 1] * off[i, b, 0]
            ahead, left = (a, b) if turns_left else (b, a)
            fourth = off[i, ahead] + off[i, left] + place[i]
            gap = np.hypot(*(place - fourth).T)
            k = int(np.argmin(gap))
            if (gap[k] < NEAR) != (corners_seen == 4):
                continue
            turn = (k if corners_seen == 4 else -1, left, i, ahead)
            key = frozenset(int(one) for one in turn)
            if len(key) == 4 and key not in found:
                rectangle = fitted(legs, turn)
                if rectangle is not None:
                    found[key] = rectangle
    return list(found.values())


def apart(one: Rectangle, other: Rectangle) -> bool:
    """Does neither lie on the other? By the sides of both (separating axes)."""
    first, second = one.corners(OVERLAP), other.corners(OVERLAP)
    for shape in (one.shape, other.shape):
        for angle in (shape[2], shape[2] + 0.5 * np.pi):
            axis = np.array([np.cos(angle), np.sin(angle)])
            a, b = first @ axis, second @ axis
            if a.max() < b.min() or b.max() < a.min():
                return True
    return False


def _worth(chosen: Sequence[Rectangle]) -> float:
    """Legs that are explained, less what the rectangles cost."""
    legs = frozenset[int]().union(*(one.known for one in chosen))
    unseen = sum(one.legs.count(-1) for one in chosen)
    misfit = sum(one.misfit for one in chosen)
    return len(legs) - COST * len(chosen) - UNSEEN_CORNER * unseen - 0.01 * misfit


def explained(found: Sequence[Rectangle]) -> list[Rectangle]:
    """The rectangles that explain most legs with the fewest."""
    chosen: list[Rectangle] = []
    left = list(found)
    while left:
        group, legs = [left.pop()], frozenset[int]()
        while True:  # all that share legs, or lie on each other
            legs = legs.union(*(one.known for one in group))
            more = [
                one for one in left
                if one.known & legs or not all(apart(one, other) for other in group)
            ]  # fmt: skip
            if not more:
                break
            group += more
            left = [one for one in left if one not in more]
        chosen += _best(group)
    return chosen


def _best(group: list[Rectangle]) -> list[Rectangle]:
    """The best way to explain the legs of a group."""
    group.sort(key=lambda one: -_worth([one]))
    if len(group) > MOST:
        taken: list[Rectangle] = []
        for one in group:
            if all(apart(one, other) for other in taken) and _worth([*taken, one]) > _worth(taken):
                taken.append(one)
        return taken
    clash = {(a, b) for a, b in combinations(range(len(group)), 2)
             if not apart(group[a], group[b])}  # fmt: skip
    ways: list[tuple[int, ...]] = [()]
    for k in range(len(group)):
        ways += [(*way, k) for way in ways if not any((j, k) in clash for j in way)]
    return max(([group[k] for k in way] for way in ways), key=_worth)
