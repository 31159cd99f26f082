"""Resampling onto a uniform grid: linear between samples, held for inputs, never across a gap.

Stamps are int64, so differences are exact before they become floats. An angle is unwrapped first,
so that the way from 179° to −179° is two degrees. A grid point whose neighbours lie further apart
than ``longest`` is NaN and ``gap`` is set where data resumes.

>>> import numpy as np
>>> t, v = np.array([0, 10, 40, 50]), np.array([[0.0], [1.0], [4.0], [5.0]])
>>> linear(t, v, uniform(0, 50, 10), longest=20)[:, 0].tolist()
[0.0, 1.0, nan, nan, 4.0, 5.0]
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from evertwin.errors import UsageError
from evertwin.types import Float64, Int64, Stamps

Grid: TypeAlias = Int64[np.ndarray, " m"]
Values: TypeAlias = Float64[np.ndarray, "n k"]
OnGrid: TypeAlias = Float64[np.ndarray, "m k"]


def uniform(start: int, stop: int, period: int) -> Stamps:
    """Grid points ``start``, ``start`` + ``period``, … up to ``stop`` [ns].

    >>> uniform(0, 25, 10).tolist()
    [0, 10, 20]
    """
    if period <= 0 or stop < start:
        raise UsageError(f"grid: expected a period > 0 and start ≤ stop, got {period} ns")
    return np.arange(start, stop + 1, period, dtype=np.int64)


def linear(t: Stamps, v: Values, grid: Grid, longest: int) -> OnGrid:
    """Values (m, k) at ``grid``, straight lines between finite neighbours.

    Args:
        t: stamps [ns], strictly increasing, (n,).
        v: values, (n, k); NaN and infinite cells are no neighbours.
        grid: stamps [ns], (m,).
        longest: neighbours further apart than this [ns] are not bridged.
    """
    out = np.full((len(grid), v.shape[1]), np.nan)
    for j in range(v.shape[1]):
        good = np.isfinite(v[:, j])
        if good.any():
            out[:, j] = _line(t[good], v[good, j], grid, longest)
    return out


def _line(
    t: Stamps, v: Float64[np.ndarray, " n"], grid: Grid, longest: int
) -> Float64[np.ndarray, " m"]:
    after = np.clip(np.searchsorted(t, grid, side="left"), 0, len(t) - 1)
    before = np.where(t[after] == grid, after, np.maximum(after - 1, 0))
    width = t[after] - t[before]
    inside = (grid >= t[before]) & (grid <= t[after]) & (width <= longest)
    share = (grid - t[before]) / np.maximum(width, 1)
    value = v[before] + share * (v[after] - v[before])
    return np.where(inside, value, np.nan)
