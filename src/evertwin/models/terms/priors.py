"""Gaussian-process priors of what lies on a grid, as modes along each channel.

The covariance of two nodes is exp(−d²/2b²) with length b, in half ranges of the channel.

>>> import numpy as np
>>> int(modes(np.linspace(-1.0, 1.0, 5), 1.0).odd.sum())      # of five modes
2
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.types import Bool, Float64, Vector

LENGTHS = (0.3, 0.4, 0.6, 1.0)
"""Lengths b of a prior, in half ranges."""
NOISES = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""Variance of a residual, in units of the prior's mean variance."""
MOST = 48
"""Most modes over two channels."""


class Modes(NamedTuple):
    """Of a prior along one channel.

    >>> Modes._fields
    ('vectors', 'variance', 'odd')
    """

    vectors: np.ndarray
    variance: np.ndarray
    odd: np.ndarray


def modes(levels: Vector, length: float) -> Modes:
    """Eigenvectors of the prior along one channel, their variances, and which are odd."""
    z = 2.0 * levels / (levels[-1] - levels[0])
    variance, vectors = np.linalg.eigh(np.exp(-((z[:, None] - z) ** 2) / (2 * length**2)))
    odd = np.abs(vectors + vectors[::-1]).sum(axis=0) < np.abs(vectors - vectors[::-1]).sum(axis=0)
    return Modes(vectors, np.maximum(variance, 0.0), odd)


def product(own: Modes, other: Modes, symmetry: str) -> Float64[np.ndarray, "nodes modes"]:
    """The strongest products of modes that have the symmetry, times their standard deviation."""
    variance = np.outer(own.variance, other.variance)
    odd, even = own.odd[:, None], ~other.odd[None, :]
    if symmetry == "both":
        variance = variance * (odd & even)
    elif symmetry == "odd":
        variance = variance * ((odd & even) | (~odd & ~even))
    order = np.argsort(variance.ravel())[::-1][:MOST]
    order = order[variance.ravel()[order] > 1e-4 * variance.max()]
    i, j = np.unravel_index(order, variance.shape)
    products = np.einsum("ak,bk->abk", own.vectors[:, i], other.vectors[:, j])
    return np.asarray(products.reshape(-1, len(order)) * np.sqrt(variance[i, j]))


def reached(
    u: Float64[np.ndarray, " n"], levels: Float64[np.ndarray, " levels"]
) -> Bool[np.ndarray, "n levels"]:
    """Which levels have a value nearer than their neighbours."""
    step = np.diff(levels)
    below, above = np.r_[step[:1], step], np.r_[step, step[-1:]]
    known = np.where(np.isfinite(u), u, levels[0])
    gap = known[:, None] - levels
    inside = (gap > -below) & (gap < above)
    inside[:, 0] |= known <= levels[0]
    inside[:, -1] |= known >= levels[-1]
    return np.asarray(inside)
