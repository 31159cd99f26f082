"""A scan onto a map: from where it is expected, or by looking at every pose around.

>>> angles = np.radians(np.arange(-90, 91, 2.0))
>>> from evertwin.features.scans.local_map import seen
>>> walls = seen(2 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles))), angles, (0, 0, 0))
>>> expected = Expected(np.array([0.02, 0.01, 0.01]), np.eye(3) * 0.01)
>>> np.abs(fitted(walls, Known.of(walls), expected, expected.pose).pose).max() < 0.002
np.True_
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.features.scans.correlation import BLOCK, CELL, Bounds, Drawing, blocks
from evertwin.features.scans.fusion import Sighting
from evertwin.features.scans.local_map import Known, Surface
from evertwin.features.scans.registration import NARROW, firmness, likelihood, register
from evertwin.signals.planar import wrapped
from evertwin.types import Float64, Vector

UNUSUAL = 7.8
"""Square of a fit's distance from what was expected, over its covariance, from which on others are
looked for: 95 % of three squares."""
DENSE = 0.8
"""Half a window below which scans overlap so far that a fit leads to the right place [m]."""
TOLD = 0.1
"""How surely a scan tells its place, so that what was expected elsewhere need not be asked [m]."""
MODES = 3
"""Places that a scan is matched from before others are looked for."""
TURNS_ALIKE = 0.15
"""How far turns may differ in steps that are alike [rad]."""
TAIL, WHEELS = 3.0, 30.0
"""Degrees of freedom of what is expected: by habit, and by the wheels."""
CLEARLY, ELSEWHERE = 5.0, 0.3
"""Logarithm of how much likelier one of two places must be, and how far apart they are two [m]."""
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
    ('pose', 'share', 'covariance', 'sighting', 'scale', 'worth', 'told', 'unseen', 'others')
    """

    pose: Pose
    share: float
    covariance: Float64[np.ndarray, "3 3"]
    sighting: Sighting
    """What the scan alone says."""
    scale: float = 0.0
    """Of how far its points lie off their walls [m]."""
    worth: float = 0.0
    """Logarithm of how likely the scan is there and this place was, up to a constant."""
    told: float = 0.0
    """The same of the scan alone."""
    unseen: float = 0.0
    """Share of the scan that lies where the map has nothing."""
    others: Float64[np.ndarray, "3 3"] = np.zeros((3, 3))
    """Of the places that it was expected in as well; see `Expected.others`."""


class Expected(NamedTuple):
    """Where a scan is looked for.

    >>> Expected(np.zeros(3), np.diag([0.04, 0.01, 0.01])).sigma[0]
    np.float64(0.2)
    """

    pose: Pose
    covariance: Float64[np.ndarray, "3 3"]
    window: tuple[Pose, float, float] | None = None
    """Where it may be, whatever was expected: middle, half the width [m], half the turn [rad]."""
    places: Float64[np.ndarray, "k 3"] | None = None
    """Where it is expected as well; see `evertwin.features.scans.habits`."""
    weights: Vector | None = None
    """How much each of them counts."""
    shared: float = 0.0
    """Scans before it that were matched to the same map."""

    @property
    def sigma(self) -> Vector:
        """Of its x, y and heading."""
        return np.sqrt(np.diag(self.covariance))

    def densities(self, poses: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n k"]:
        """Of poses by each place, up to a factor; Student's, as robots start and stop."""
        if self.places is None or self.weights is None:
            off, weights, metric = poses[:, None] - self.pose, np.ones(1), self.covariance
        else:
            off, weights = poses[:, None] - self.places, self.weights
            metric = np.diag([0.0, 0.0, TURNS_ALIKE**2])
            metric[:2, :2] = self.covariance[:2, :2]
        off[..., 2] = wrapped(off[..., 2])
        square = np.einsum("nki,ij,nkj->nk", off, np.linalg.inv(metric), off)
        tail = WHEELS if self.places is None else TAIL
        return np.asarray(weights * (1 + square / tail) ** (-0.5 * (tail + 3)))

    def others(self, pose: Pose, modes: Sequence[Pose], told: Vector) -> Float64[np.ndarray, "3 3"]:
        """Covariance of the places that it is expected in about the one that leads to a pose.

        A robot may go on as it did before, and nothing but its scans tells which it does: ``told``,
        the logarithm of how likely the scan is about each of the ``modes``.
        """
        found = np.zeros((3, 3))
        if self.places is not None and self.weights is not None:
            off = self.places[:, None, :2] - np.array(modes)[:, :2]
            nearest = np.einsum("kmi,kmi->km", off, off).argmin(axis=1)
            weights = self.weights * np.exp(told - told.max())[nearest]
            away = (self.places - self.about(pose))[:, :2]
            found[:2, :2] = np.einsum("n,ni,nj->ij", weights / weights.sum(), away, away)
        return found

    def about(self, pose: Pose) -> Pose:
        """Which of the expected places leads to a pose."""
        return (
            self.pose if self.places is None else self.places[self.densities(pose[None]).argmax()]
        )

    def modes(self) -> list[Pose]:
        """The likeliest of the expected places, each `ELSEWHERE` than those before."""
        if self.places is None:
            return [self.pose]
        found: list[Pose] = []
        for k in np.argsort(-self.densities(self.places).sum(axis=1)):
            one = self.places[k]
            if all(math.hypot(*(one - other)[:2]) > ELSEWHERE for other in found):
                found.append(one)
        return found[:MODES]

    def square(self, pose: Pose) -> float:
        """Of how far a pose is off the place that leads there, over the covariance."""
        off = pose - self.about(pose)
        off[2:] = wrapped(off[2:])
        return float(off @ np.linalg.solve(self.covariance, off))


def best(scan: Surface, view: Known, expected: Expected, sure: float) -> Fit:
    """The likeliest of `ranked`; what another one tells otherwise is left open."""
    first, *others = ranked(scan, view, expected, sure)
    return undecided(first, others[0], first.worth - others[0].worth) if others else first


def ranked(scan: Surface, view: Known, expected: Expected, sure: float) -> list[Fit]:
    """The scan where it is expected or, where that is in doubt, where it most likely is.

    In doubt it is where the fit explains too little, or loosely, or lies where it was hardly
    expected, and where steps are so long that a fit may lead elsewhere. Then the two best places of
    the window are looked at as well. Each is judged by how likely the scan is there and how well
    that place was expected.

    Returns:
        the likeliest, and others that are `ELSEWHERE` and nearly as likely (`CLEARLY`).
    """
    fit, some = fitted(scan, view, expected, expected.pose), balanced(scan)
    sparse = expected.window is not None and expected.window[1] > DENSE
    loose = fit.share < sure or fit.scale > NARROW  # its walls are far, or none
    doubt = sparse or loose or expected.square(fit.pose) > UNUSUAL
    open_ = np.linalg.eigvalsh(fit.sighting.information[:2, :2])[0] < 1 / TOLD**2
    modes = expected.modes() if doubt or open_ else [expected.pose]
    starts = [*modes[1:], *(searched(some, view, expected) if doubt else [])]
    fits = [fit, *(fitted(scan, view, expected, start) for start in starts)]
    prior = np.log(expected.densities(np.array([one.pose for one in fits])).sum(axis=1))
    told = [likelihood(some, len(some), *view, one.pose) for one in fits]
    likely = len(some) / ALIKE * np.array([mean for mean, _ in told])
    fits = [
        one._replace(worth=float(mean + p), told=float(mean), unseen=unseen)
        for one, mean, p, (_, unseen) in zip(fits, likely, prior, told, strict=True)
    ]
    kept: list[Fit] = []
    for one in sorted(fits, key=lambda one: -one.worth):
        far = all(math.hypot(*(one.pose - other.pose)[:2]) > ELSEWHERE for other in kept)
        if far and (not kept or kept[0].worth - one.worth < CLEARLY):
            kept.append(one)
    near = likely[: len(modes)]
    return [one._replace(others=expected.others(one.pose, modes, near)) for one in kept]


def undecided(fit: Fit, other: Fit, better: float) -> Fit:
    """A fit that says nothing of the direction in which another one lies that is nearly as likely.

    As the mixture of both has it, ``better`` being the logarithm of the ratio of their weights.
    """
    d, share = other.pose - fit.pose, 1 / (1 + math.exp(better))
    told = fit.sighting.information
    along = told @ d
    told = told - np.outer(along, along) / (1 / share + float(d @ along))
    return fit._replace(
        covariance=fit.covariance + share * np.outer(d, d),
        sighting=fit.sighting._replace(information=told),
    )


def searched(some: Surface, view: Known, expected: Expected) -> list[Pose]:
    """The best place of the window by all its poses, and the best elsewhere."""
    if expected.window is None:
        half, turn = (WINDOW * expected.sigma[k] for k in (0, 2))
        middle, half, turn = expected.pose, min(half, WIDEST), min(turn, math.pi)
    else:
        middle, half, turn = expected.window
    drawing, side = Drawing.of(view.points, middle[:2], GRID), blocks(half)
    steps, found = BLOCK * CELL * (np.arange(side) - side // 2 + 0.5), []
    allowed = np.ones((side, side), np.uint8)
    bounds = Bounds.of(some, drawing, np.array([half, turn, TURN]), side, middle)
    for _ in range(2):
        pose, value = bounds.search(allowed)
        if value > 0:
            found.append(pose)
        x, y = (pose - middle)[:2]
        allowed[np.hypot(steps[:, None] - x, steps[None, :] - y) < 2 * ELSEWHERE] = 0
    return found


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
    """The best pose within ``window`` (m, rad) to either side of ``middle``; see `Bounds`."""
    drawing, side = Drawing.of(points, middle[:2], GRID), blocks(window[0])
    everywhere = np.ones((side, side), np.uint8)
    bounds = Bounds.of(scan, drawing, np.array([*window, TURN]), side, middle)
    return bounds.search(everywhere)[0]


def fitted(scan: Surface, view: Known, expected: Expected, start: Pose) -> Fit:
    """The scan matched from ``start``, with what is expected of its pose."""
    pose, information = start.copy(), np.zeros((3, 3))
    doubt = (TAIL + expected.square(start)) / (TAIL + 3)
    weight = ALIKE / max(doubt, 1.0) * np.linalg.inv(expected.covariance)
    prior = expected.about(start)
    share, scale, alike = register(
        scan, len(scan), view.points, view.heads, view.order, prior, weight, pose, information
    )
    covariance = ALIKE * np.linalg.inv(information + weight) + COMMON
    # without the expectation: where its pull and the scan's were in balance
    alone = pose + np.linalg.solve(information + np.eye(3), weight @ (pose - prior))
    r = min(max(alike, 0.0), MOST_ALIKE)
    firm = firmness(scan, len(scan), *view, pose, scale, float(expected.shared))
    honest = firm * ((1 - r) / (1 + r) / GAUSSIAN)
    return Fit(pose, share, covariance, Sighting(alone, honest), scale)
