"""Quantiles of what has weights, and of what was only seen to last longer.

>>> quantile_of(np.array([3.0, 1.0, 2.0]), np.ones(3), 0.5)
2.0
"""

from __future__ import annotations

import numpy as np

from evertwin.types import Bools, Vector


def shared(value: Vector, weight: Vector, ended: Bools) -> Vector:
    """Weights where what still runs shares its own among all that lasted longer (Kaplan, Meier).

    What lasted longest keeps its weight, whether it has ended or not.

    >>> shared(np.array([1.0, 2.0, 3.0]), np.ones(3), np.array([True, False, True])).tolist()
    [1.0, 0.0, 2.0]
    """
    order = np.lexsort((~ended, value))
    own, over = weight[order], ended[order].copy()
    over[-1] = True
    share = np.where(over, own / np.maximum(np.cumsum(own[::-1])[::-1], 1e-300), 0.0)
    lasts = np.concatenate([[1.0], np.cumprod(1.0 - share)[:-1]])
    out = np.empty(len(value))
    out[order] = lasts * share * own.sum()
    return out


def quantiles_of(off: Vector, weight: Vector) -> tuple[float, float, float]:
    """Weighted quantiles at 10, 50 and 90 %; the outer ones lie around the middle one."""
    low, half, high = (quantile_of(off, weight, p) for p in (0.1, 0.5, 0.9))
    return low, half, high


def quantile_of(value: Vector, weight: Vector, p: float) -> float:
    """Weighted quantile; 0 of none."""
    if not weight.any():
        return 0.0
    order = np.argsort(value)
    order = order[weight[order] > 0.0]
    share = np.cumsum(weight[order]) - 0.5 * weight[order]
    return float(np.interp(p * weight.sum(), share, value[order]))
