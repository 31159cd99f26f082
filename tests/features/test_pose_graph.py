"""How far the steps of a map err, by the loops that say so."""

from __future__ import annotations

import numpy as np

from evertwin.features.maps.pose_graph import Edge, variance_factor, visits
from evertwin.features.scans.fusion import WIDEST, Belief, Sighting, measured
from evertwin.signals.planar import between, chained

OUT, BACK = 30, 10
SPREAD = np.diag([0.01, 0.01, 0.002]) ** 2


def drawn(seed: int) -> tuple[np.ndarray, list[Edge], list[Edge]]:
    """A way out and back, followed with the error that its steps state, and one visit's loops."""
    noisy = np.random.default_rng(seed)
    steps = np.tile([0.5, 0.0, 0.1], (OUT + BACK, 1))
    truth = chained(np.zeros(3), steps)
    poses = chained(np.zeros(3), steps + noisy.normal(size=steps.shape) * np.sqrt(np.diag(SPREAD)))
    told = between(poses[:-1], poses[1:])
    edges = [Edge(k, k + 1, step, SPREAD) for k, step in enumerate(told)]
    pairs = [(k, OUT + k) for k in range(BACK)]
    again = [(i, j, between(truth[i], truth[j])) for i, j in pairs]
    return poses, edges, [Edge(i, j, step, 1e-4 * SPREAD, loop=True) for i, j, step in again]


def test_loops_of_one_visit_do_not_say_that_steps_err_less_than_they_do() -> None:
    """They agree by chance: one map in ten had covariances too small by four and more."""
    factors = np.array([variance_factor(*drawn(seed)) for seed in range(100)])
    assert visits(drawn(0)[2]) == 1
    assert np.mean(factors < 0.25) < 0.05 and np.mean(factors < 1.0) < 0.35
    assert np.median(factors) < 5.0


def test_a_place_that_nothing_tells_stays_within_numbers() -> None:
    """Along a corridor each surprise made it wider, until a map ended with "Singular matrix"."""
    belief = Belief.at_rest(0, np.zeros(3), np.diag([1.0, 1e-4, 1e-6]))
    across = np.diag([0.0, 1e6, 1e8])
    for k in range(60):
        off = np.array([0.0, 0.2 * (-1) ** k, 0.02 * (-1) ** k])
        belief = measured(belief, Sighting(off, across), way=0.0).belief
    assert np.sqrt(belief.covariance[0, 0]) < 2 * WIDEST
    assert np.linalg.matrix_rank(belief.covariance[:3, :3]) == 3
