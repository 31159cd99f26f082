"""A scan onto a map: from where it is expected, or by looking at every pose around.

>>> angles = np.radians(np.arange(-90, 91, 2.0))
>>> from evertwin.features.local_map import seen
>>> walls = seen(2 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles))), angles, (0, 0, 0))
>>> expected = Expected(np.array([0.02, 0.01, 0.01]), np.eye(3) * 0.01)
>>> np.abs(fitted(walls, Known.of(walls), expected, expected.pose).pose).max() < 0.002
np.True_
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from evertwin.features.correlation import Drawing, blocks, search
from evertwin.features.fusion import Sighting
from evertwin.features.local_map import Known, Surface
from evertwin.features.registration import explained, register
from evertwin.types import Float64, Vector

BETTER = 0.02
"""By how much more of the scan a pose from elsewhere must explain."""
WINDOW = 3.0
"""Half the window that is searched, in standard deviations of the expectation."""
WIDEST = 1.6
"""Its largest half width [m]."""
TURN = 0.03
"""Step between the headings that are tried [rad]."""
SOME = 80
"""Points of a scan that a search uses."""
DIRECTIONS = 8
"""Kinds of walls, by where they face."""
GRID = 512
"""Cells of the grid that it looks into, along each side."""
COMMON = np.diag([0.001, 0.001, 0.0003]) ** 2
"""Error that all points of a map share (m², m², rad²)."""
ALIKE = 5.0
"""Neighbouring beams that err together: so many count as one."""
GAUSSIAN = 0.68
"""Variance of what is matched by Cauchy's weights, over that which these weights state, for normal
noise: E ψ² / (E ψ')² over c² / E w at a scale c of 1.5 weighted deviations."""
MOST_ALIKE = 0.8
"""Largest correlation of neighbouring residuals that is believed."""

Pose = Float64[np.ndarray, " 3"]


class Fit(NamedTuple):
    """A scan at a pose of the map.

    >>> Fit._fields
    ('pose', 'share', 'covariance', 'sighting')
    """

    pose: Pose
    share: float
    covariance: Float64[np.ndarray, "3 3"]
    sighting: Sighting
    """What the scan alone says."""


class Expected(NamedTuple):
    """Where a scan is looked for.

    >>> Expected(np.zeros(3), np.diag([0.04, 0.01, 0.01])).sigma[0]
    np.float64(0.2)
    """

    pose: Pose
    covariance: Float64[np.ndarray, "3 3"]

    @property
    def sigma(self) -> Vector:
        """Of its x, y and heading."""
        return np.sqrt(np.diag(self.covariance))


def best(scan: Surface, view: Known, expected: Expected, sure: float) -> Fit:
    """The scan where it is expected or, if that explains too little, where it fits best."""
    fit = fitted(scan, view, expected, expected.pose)
    if fit.share >= sure:
        return fit
    some = balanced(scan)
    found = found_by_search(some, view.points, expected.pose, (
        min(WINDOW * expected.sigma[0], WIDEST), min(WINDOW * expected.sigma[2], math.pi)
    ))  # fmt: skip
    other = fitted(scan, view, expected, found)
    here, there = (explained(some, len(some), *view, one.pose) for one in (fit, other))
    return other if there > here + BETTER else fit


def balanced(scan: Surface) -> Surface:
    """Some points of a scan, from walls of every direction alike: else the long ones decide alone.

    Rusinkiewicz and Levoy, 3DIM 2001.
    """
    facing = np.floor(np.arctan2(scan[:, 3], scan[:, 2]) / (2 * np.pi) * DIRECTIONS) % DIRECTIONS
    facing[(scan[:, 2] == 0) & (scan[:, 3] == 0)] = DIRECTIONS
    kinds = [np.flatnonzero(facing == k) for k in range(DIRECTIONS + 1)]
    kinds = sorted((kind for kind in kinds if len(kind)), key=len)
    chosen, left = [], SOME
    for k, kind in enumerate(kinds):
        take = min(len(kind), left // (len(kinds) - k))
        chosen.append(kind[np.linspace(0, len(kind) - 1, take).astype(np.int64)])
        left -= take
    return np.ascontiguousarray(scan[np.sort(np.concatenate(chosen))])


def found_by_search(
    scan: Surface, points: Surface, middle: Pose, window: tuple[float, float]
) -> Pose:
    """The best pose within ``window`` (m, rad) to either side of ``middle``; see `search`."""
    drawing, side = Drawing.of(points, middle[:2], GRID), blocks(window[0])
    everywhere = np.ones((side, side), np.uint8)
    return search(scan, drawing, np.array([*window, TURN]), everywhere, middle)[0]


def fitted(scan: Surface, view: Known, expected: Expected, start: Pose) -> Fit:
    """The scan matched from ``start``, with what is expected of its pose."""
    pose, information = start.copy(), np.zeros((3, 3))
    weight = ALIKE * np.linalg.inv(expected.covariance)
    share, _, alike = register(
        scan, len(scan), view.points, view.heads, view.order, expected.pose, weight, pose,
        information,
    )  # fmt: skip
    covariance = ALIKE * np.linalg.inv(information + weight) + COMMON
    # without the expectation: where its pull and the scan's were in balance
    alone = pose + np.linalg.solve(information + np.eye(3), weight @ (pose - expected.pose))
    r = min(max(alike, 0.0), MOST_ALIKE)
    honest = information * ((1 - r) / (1 + r) / GAUSSIAN)
    return Fit(pose, share, covariance, Sighting(alone, honest))
