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

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.signals.series import Series
from evertwin.types import Bool, Bools, Float64, Int64, Stamps

Grid: TypeAlias = Int64[np.ndarray, " m"]
Values: TypeAlias = Float64[np.ndarray, "n k"]
OnGrid: TypeAlias = Float64[np.ndarray, "m k"]

__all__ = ["Resampled", "hold", "linear", "resample", "uniform"]


class Resampled(NamedTuple):
    """A series on a uniform grid.

    >>> Resampled._fields
    ('series', 'gap')
    """

    series: Series
    gap: Bools
    """True at the first row after a gap: the state starts anew."""


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


def hold(t: Stamps, v: Values, grid: Grid, longest: int) -> OnGrid:
    """Values (m, k) at ``grid``, each the newest finite one at or before it; see `linear`.

    >>> import numpy as np
    >>> hold(np.array([0, 10]), np.array([[1.0], [2.0]]), np.array([5, 10, 90]), 50)[:, 0].tolist()
    [1.0, 2.0, nan]
    """
    out = np.full((len(grid), v.shape[1]), np.nan)
    for j in range(v.shape[1]):
        good = np.isfinite(v[:, j])
        if good.any():
            stamps, values = t[good], v[good, j]
            at = np.searchsorted(stamps, grid, side="right") - 1
            known = (at >= 0) & (grid - stamps[np.maximum(at, 0)] <= longest)
            out[:, j] = np.where(known, values[np.maximum(at, 0)], np.nan)
    return out


def resample(series: Series, period: int, held: Sequence[str] = (), longest: int = 0) -> Resampled:
    """``series`` on a uniform grid that begins at its first stamp.

    Args:
        series: n ≥ 2 rows.
        period: grid interval [ns].
        held: channels that hold their value between samples (commands).
        longest: longest interval that is bridged [ns]; 0: five median intervals.

    Raises:
        DataError: fewer than two rows.
    """
    if len(series.t) < 2:
        raise DataError(f"resampling: expected at least 2 rows, got {len(series.t)}")
    longest = longest or 5 * series.period
    grid = uniform(int(series.t[0]), int(series.t[-1]), period)
    values = series.v.copy()
    for j in np.flatnonzero(series.layout.angles):
        good = np.isfinite(values[:, j])
        values[good, j] = np.unwrap(values[good, j])
    out = linear(series.t, values, grid, longest)
    if held:
        columns = [series.layout.index(name) for name in held]
        out[:, columns] = hold(series.t, series.v[:, columns], grid, longest)
    return Resampled(Series(series.layout, grid, out), _gaps(series.t, grid, longest))


def _gaps(t: Stamps, grid: Grid, longest: int) -> Bool[np.ndarray, " m"]:
    """True at the first grid point at or after each sample that ends a gap."""
    gap = np.zeros(len(grid), dtype=np.bool_)
    ends = t[1:][np.diff(t) > longest]
    at = np.searchsorted(grid, ends)
    gap[at[at < len(grid)]] = True
    return gap
