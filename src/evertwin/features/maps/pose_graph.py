"""A pose graph: keyframes, the steps between them, and the places that were seen again.

Solved by GTSAM (Levenberg and Marquardt; Dellaert and Kaess, 2017), by orthogonal factors: a bare
corridor leaves its own direction some 10⁸ times less known than the one across, which squares would
lose. A step that a loop tells may be wrong altogether, so it weighs little where the others
contradict it (Cauchy). The first keyframe is the origin.

>>> step = Edge(0, 1, np.array([1.0, 0.0, 0.0]), np.eye(3) * 1e-4)
>>> again = Edge(0, 1, np.array([1.1, 0.0, 0.0]), np.eye(3) * 1e-4)
>>> optimised(np.zeros((2, 3)), [step, again]).poses[1].round(3).tolist()
[1.05, 0.0, 0.0]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.signals.planar import between, compose
from evertwin.sources.foreign import load
from evertwin.types import Float64

FIRST = 1e-3
"""Standard deviation of the origin [m, rad]."""
DOUBT = 1.0
"""Standard deviations from which on a loop weighs less."""


TELLING = 5
"""Loops from which on they say how far the steps err."""
FACTORS = (0.02, 10.0)
"""Least and largest factor that they say."""
CAUTION = 0.2
"""How often chance alone makes loops of so many visits agree as well as they are let do."""
TOGETHER = 20
"""Keyframes from one loop to the next, at either end, up to which both are of one visit."""
WORST = 30.0
"""Square of a loop's error over its covariance beyond which it is no error but another place."""


OPEN = 0.02
"""Standard deviation of a step from which on its scan left a direction open [m]."""
HALVINGS = 20


class Edge(NamedTuple):
    """A step from one keyframe to another.

    >>> Edge(3, 4, np.zeros(3), np.eye(3)).loop
    False
    """

    start: int
    end: int
    step: Float64[np.ndarray, " 3"]
    """In the frame of ``start``."""
    covariance: Float64[np.ndarray, "3 3"]
    """In the frame of ``end``."""
    loop: bool = False


class Optimised(NamedTuple):
    """Keyframes as all edges together tell them.

    >>> Optimised(np.zeros((1, 3)), np.zeros((1, 3, 3))).failed
    False
    """

    poses: Float64[np.ndarray, "n 3"]
    covariances: Float64[np.ndarray, "n 3 3"]
    """Relative to the first, in the frame of the map."""
    failed: bool = False
    """The edges could not be brought together: the poses are those of the start."""


def turned(covariance: np.ndarray, heading: float) -> np.ndarray:
    """A covariance (3, 3) of x, y and heading, seen from a frame that is turned by ``heading``."""
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turn @ covariance @ turn.T)


def optimised(
    start: Float64[np.ndarray, "n 3"],
    edges: Sequence[Edge],
    origin: Float64[np.ndarray, "3 3"] | None = None,
) -> Optimised:
    """The poses that fit the edges best, from ``start``; else ``start`` itself.

    Args:
        start: of each keyframe.
        edges: between them.
        origin: covariance of the first, in its own frame, about the map; None: it is the map's.

    Raises:
        MissingExtra: GTSAM is not installed.
    """
    gtsam = load("gtsam", "perception")
    origin = FIRST * FIRST * np.eye(3) if origin is None else origin
    try:
        return _fitted(gtsam, start, edges, origin)
    except RuntimeError:
        return Optimised(start, _along(start, edges), failed=True)


def _fitted(
    gtsam: Any, start: Float64[np.ndarray, "n 3"], edges: Sequence[Edge], origin: np.ndarray
) -> Optimised:
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    fixed = gtsam.noiseModel.Gaussian.Covariance(origin)
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*start[0]), fixed))
    for k, pose in enumerate(start):
        values.insert(k, gtsam.Pose2(*pose))
    for edge in edges:
        noise = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
        if edge.loop:
            doubt = gtsam.noiseModel.mEstimator.Cauchy.Create(DOUBT)
            noise = gtsam.noiseModel.Robust.Create(doubt, noise)
        step = gtsam.Pose2(*edge.step)
        graph.add(gtsam.BetweenFactorPose2(edge.start, edge.end, step, noise))
    settings = gtsam.LevenbergMarquardtParams()
    settings.setLinearSolverType("MULTIFRONTAL_QR")
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, settings).optimize()
    order, by = gtsam.Ordering.OrderingType.COLAMD, gtsam.EliminateQR
    tree = graph.linearize(found).eliminateMultifrontal(order, by)
    poses = np.array([[p.x(), p.y(), p.theta()] for p in map(found.atPose2, range(len(start)))])
    known = np.array([tree.marginalFactor(k, by).information() for k in range(len(start))])
    around = [turned(one, -p[2]) for one, p in zip(np.linalg.inv(known), poses, strict=True)]
    return Optimised(poses, np.array(around))


def _along(
    poses: Float64[np.ndarray, "n 3"], edges: Sequence[Edge]
) -> Float64[np.ndarray, "n 3 3"]:
    """Covariances by the steps alone, from the first pose on."""
    found = np.tile(FIRST * FIRST * np.eye(3), (len(poses), 1, 1))
    for edge in sorted((edge for edge in edges if not edge.loop), key=lambda edge: edge.end):
        x, y = (poses[edge.end] - poses[edge.start])[:2]
        lever = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
        step = turned(edge.covariance, -poses[edge.end, 2])
        found[edge.end] = lever @ found[edge.start] @ lever.T + step
    return found


def at_origin(pose: np.ndarray, own: bool = True) -> Float64[np.ndarray, "3 3"]:
    """An error in the frame of a pose, as a motion of the whole plane about the origin.

    ``own``: of its own axes, else of those of the map.
    """
    c, s = (np.cos(pose[2]), np.sin(pose[2])) if own else (1.0, 0.0)
    return np.array([[c, -s, pose[1]], [s, c, -pose[0]], [0.0, 0.0, 1.0]])


def weak(edge: Edge) -> bool:
    """Does its scan leave a direction open?

    >>> weak(Edge(0, 1, np.zeros(3), np.eye(3)))
    True
    """
    return bool(np.linalg.eigvalsh(edge.covariance[:2, :2])[-1] > OPEN * OPEN)


def visits(loops: Sequence[Edge]) -> int:
    """How often a robot came back to where it had been.

    >>> visits([Edge(a, b, np.zeros(3), np.eye(3)) for a, b in ((1, 50), (3, 52), (60, 95))])
    2
    """
    ends = np.array(sorted((loop.end, loop.start) for loop in loops))
    return 1 + int((np.abs(np.diff(ends, axis=0)).max(axis=1, initial=0) > TOGETHER).sum())


def variance_factor(
    poses: Float64[np.ndarray, "n 3"], steps: Sequence[Edge], loops: Sequence[Edge]
) -> float:
    """How far the steps err, as a factor on the covariances of those that are not `weak`.

    It makes what the loops are off, squared over its covariance, 3 on average, or the less the
    fewer visits they are of (`CAUTION`): the loops of one visit err together. The steps' own
    covariances are those of single scans on a map: a map averages, and what is in no model (glass,
    people, a floor that is not level) adds up. 1 where few loops tell.

    Args:
        poses: of the keyframes, by the steps alone.
        steps: from each keyframe to the next.
        loops: between keyframes far apart.
    """
    if len(loops) < TELLING:
        return 1.0
    turns = [at_origin(pose) for pose in poses]
    parts = np.zeros((2, len(poses), 3, 3))
    for edge in steps:
        parts[int(weak(edge)), edge.end] = turns[edge.end] @ edge.covariance @ turns[edge.end].T
    firm, open_ = np.cumsum(parts, axis=1)
    ends = [(loop.start, loop.end) for loop in loops]
    back = np.array([np.linalg.inv(turns[j]) for _, j in ends])
    ahead = back.transpose(0, 2, 1)
    known = np.array([loop.covariance for loop in loops])
    known += back @ np.array([open_[j] - open_[i] for i, j in ends]) @ ahead
    told = back @ np.array([firm[j] - firm[i] for i, j in ends]) @ ahead
    off = np.array([between(compose(poses[e.start], e.step), poses[e.end]) for e in loops])
    chance = 2 * float(scipy.special.gammaincinv(1.5 * visits(loops), CAUTION)) / visits(loops)
    low, high = np.log(FACTORS)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        spread = np.exp(middle) * told + known
        square = np.einsum("ni,nij,nj->n", off, np.linalg.inv(spread), off)
        low, high = (middle, high) if np.minimum(square, WORST).mean() > chance else (low, middle)
    return float(np.exp(high))
