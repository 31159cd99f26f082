"""Have two outputs changed places, as crossed cables or columns would have it?

Each measured output is held against each that is predicted in its unit; the assignment that leaves
least of the deviation is asked for. That a machine changed so that one output becomes another is
not to be expected, and nothing is learned from it.

>>> rng = np.random.default_rng(0)
>>> expected = rng.normal(size=(200, 3)); measured = expected + 0.01 * rng.normal(size=(200, 3))
>>> exchanged(measured[:, [0, 2, 1]], expected, ("Nm",) * 3)
(0, 2, 1)
>>> exchanged(measured, expected, ("Nm",) * 3)
(0, 1, 2)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from evertwin.types import Outputs, PerOutput

LEFT = 0.01
"""Largest share of the squared deviation that the exchange may leave."""


def exchanged(
    measured: Outputs, expected: Outputs, units: Sequence[str], sizes: PerOutput | float = 1.0
) -> tuple[int, ...]:
    """Of each measured output the one that it looks like; its own where no exchange does.

    Args:
        measured: (n, ny); NaN where there is none.
        expected: (n, ny).
        units: of each output; only those alike can change places.
        sizes: what 1 is in each output's recording, (ny,): of crossed cables it is the recorded
            numbers that change places, amperes of two motors, say, each with its own constant.
    """
    measured, expected = measured / sizes, expected / sizes
    ny, own = measured.shape[1], tuple(range(measured.shape[1]))
    known = np.isfinite(measured).all(axis=1) & np.isfinite(expected).all(axis=1)
    if not known.any():
        return own
    y, z = measured[known], expected[known]
    size = np.maximum(np.mean(np.square(y), axis=0), np.finfo(float).tiny)
    cost = np.mean(np.square(y[:, :, None] - z[:, None, :]), axis=0) / size[:, None]
    alike = np.array([[a == b for b in units] for a in units])
    places, looks = scipy.optimize.linear_sum_assignment(np.where(alike, cost, 1e12))
    found = tuple(looks[np.argsort(places)].tolist())
    moved = [k for k in range(ny) if found[k] != k]
    before = sum(float(cost[k, k]) for k in moved)
    return found if sum(float(cost[k, found[k]]) for k in moved) < LEFT * before else own
