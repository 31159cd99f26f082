"""How far predictions were from measurements, from sums over rows.

>>> sums = Sums(np.array([0.01]), np.array([4.0]), np.array([1]))
>>> deviation(sums, relative=True).round(3).tolist()
[0.05]
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.types import Vector


class Sums(NamedTuple):
    """Sums over the rows with a known residual, per output.

    >>> new_sums(2).residual.tolist()
    [0.0, 0.0]
    """

    residual: Vector
    """Σ residual²."""
    measured: Vector
    """Σ measurement² over the same rows."""
    samples: np.ndarray
    """Rows, int64."""


def new_sums(outputs: int) -> Sums:
    """Empty sums."""
    return Sums(np.zeros(outputs), np.zeros(outputs), np.zeros(outputs, dtype=np.int64))


class Usual(NamedTuple):
    """How large the measurements of moving rows have been since the start, whatever was live.

    >>> new_usual(2).samples.tolist()
    [0, 0]
    """

    measured: Vector
    """Σ measurement², per output."""
    samples: np.ndarray
    """Rows with a residual, int64."""


def new_usual(outputs: int) -> Usual:
    """Nothing was measured yet."""
    return Usual(np.zeros(outputs), np.zeros(outputs, dtype=np.int64))


@njit(cache=True)
def mean_square(k: int, sums: Any, usual: Any) -> float:
    """Mean square of an output's measurements, which its residual is relative to.

    Never less than usual: where a window is short, lacks samples or hardly moves, a few rows near
    zero make no deviation large.
    """
    size = sums[1][k] / sums[2][k]
    return float(max(size, usual[0][k] / usual[1][k]) if usual[1][k] > 0 else size)


def judged_deviation(sums: Sums, relative: bool, usual: Usual) -> Vector:
    """Rms of the residual per output, relative to what is usually measured or not."""
    base = np.ones(len(sums.samples))
    if relative:
        for k in np.flatnonzero(sums.samples).tolist():
            base[k] = mean_square(k, sums, usual)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: Vector = np.sqrt(sums.residual / sums.samples / base)
    return ratio


def deviation(sums: Sums, relative: bool) -> Vector:
    """Rms of the residual per output, relative to the measurement's or not; NaN without rows."""
    count = np.where(sums.samples > 0, sums.samples, np.nan)
    base = sums.measured if relative else count
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: Vector = np.sqrt(sums.residual / np.where(sums.samples > 0, base, np.nan))
    return ratio
