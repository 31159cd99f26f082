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

    >>> new_usual(2).rows.tolist()
    [0]
    """

    measured: Vector
    """Σ measurement², per output."""
    samples: np.ndarray
    """Rows with a residual, int64."""
    rows: np.ndarray
    """All rows, int64 (1,)."""


def new_usual(outputs: int) -> Usual:
    """Nothing was measured yet."""
    return Usual(np.zeros(outputs), np.zeros(outputs, dtype=np.int64), np.zeros(1, dtype=np.int64))


@njit(cache=True)
def mean_square(k: int, sums: Any, usual: Any, window: int) -> float:
    """Mean square of an output's measurements, which its residual is relative to.

    Samples that this output usually has in ``window`` rows and now lacks, because they were lost
    or a task ended, count with the size that they usually have: a few rows near zero make no
    deviation large.
    """
    measured, samples, rows = usual
    if rows[0] == 0 or samples[k] == 0:
        return float(sums[1][k] / sums[2][k])
    lacks = max(window * samples[k] / rows[0] - sums[2][k], 0.0)
    return float((sums[1][k] + lacks * measured[k] / samples[k]) / (sums[2][k] + lacks))


def judged_deviation(sums: Sums, relative: bool, usual: Usual, window: int) -> Vector:
    """Rms of the residual per output, relative to what a window of so many rows measures."""
    if not relative:
        return deviation(sums, relative=False)
    known = np.flatnonzero(sums.samples > 0)
    values = np.full(len(sums.samples), np.nan)
    for k in known.tolist():
        base = mean_square(k, sums, usual, window)
        values[k] = np.sqrt(sums.residual[k] / sums.samples[k] / base) if base > 0.0 else np.inf
    return values


def deviation(sums: Sums, relative: bool) -> Vector:
    """Rms of the residual per output, relative to the measurement's or not; NaN without rows."""
    count = np.where(sums.samples > 0, sums.samples, np.nan)
    base = sums.measured if relative else count
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: Vector = np.sqrt(sums.residual / np.where(sums.samples > 0, base, np.nan))
    return ratio
