"""A pose graph: keyframes, the steps between them, and the places that were seen again.

Solved by GTSAM (Levenberg and Marquardt; Dellaert and Kaess, 2017). A step that a loop tells may be
wrong altogether, so it weighs little where the others contradict it (Cauchy). The first keyframe is
the origin.

>>> step = Edge(0, 1, np.array([1.0, 0.0, 0.0]), np.eye(3) * 1e-4)
>>> again = Edge(0, 1, np.array([1.1, 0.0, 0.0]), np.eye(3) * 1e-4)
>>> optimised(np.zeros((2, 3)), [step, again]).poses[1].round(3).tolist()
[1.05, 0.0, 0.0]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.sources.foreign import load
from evertwin.types import Float64

FIRST = 1e-3
"""Standard deviation of the origin [m, rad]."""
DOUBT = 1.0
"""Standard deviations from which on a loop weighs less."""


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

    >>> Optimised(np.zeros((1, 3)), np.zeros((1, 3, 3))).poses.shape
    (1, 3)
    """

    poses: Float64[np.ndarray, "n 3"]
    covariances: Float64[np.ndarray, "n 3 3"]
    """Relative to the first, in the frame of the map."""


def turned(covariance: np.ndarray, heading: float) -> np.ndarray:
    """A covariance (3, 3) of x, y and heading, seen from a frame that is turned by ``heading``."""
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turn @ covariance @ turn.T)


def optimised(start: Float64[np.ndarray, "n 3"], edges: Sequence[Edge]) -> Optimised:
    """The poses that fit the edges best, from ``start``.

    Raises:
        MissingExtra: GTSAM is not installed.
    """
    gtsam = load("gtsam", "perception")
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    fixed = gtsam.noiseModel.Isotropic.Sigma(3, FIRST)
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
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    marginals = gtsam.Marginals(graph, found)
    poses = np.array([[p.x(), p.y(), p.theta()] for p in map(found.atPose2, range(len(start)))])
    around = [turned(marginals.marginalCovariance(k), -p[2]) for k, p in enumerate(poses)]
    return Optimised(poses, np.array(around))
