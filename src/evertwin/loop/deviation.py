"""Accounts: how far predictions were from measurements, summed row by row.

Sums run in the order of the rows, never by block, so that a cut cannot change a bit.

>>> sums = new_sums(outputs=1)
>>> sums = add(sums, np.array([[0.1], [np.nan]]), np.array([[2.0], [2.0]]))
>>> sums.samples.tolist(), deviation(sums, relative=True).round(3).tolist()
([1], [0.05])
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from evertwin.types import Outputs, Vector

__all__ = ["Sums", "add", "deviation", "new_sums"]


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


@njit(cache=True)
def _add(residual: Any, measured: Any, count: Any, r: Any, y: Any) -> None:
    for i in range(r.shape[0]):
        for k in range(r.shape[1]):
            if r[i, k] == r[i, k]:
                residual[k] += r[i, k] * r[i, k]
                measured[k] += y[i, k] * y[i, k]
                count[k] += 1


def add(sums: Sums, residual: Outputs, measured: Outputs) -> Sums:
    """With more rows; NaN residuals are left out. Consumes ``sums``."""
    _add(*sums, residual, measured)
    return sums


def deviation(sums: Sums, relative: bool) -> Vector:
    """Rms of the residual per output, relative to the measurement's or not; NaN without rows."""
    count = np.where(sums.samples > 0, sums.samples, np.nan)
    base = sums.measured if relative else count
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: Vector = np.sqrt(sums.residual / np.where(sums.samples > 0, base, np.nan))
    return ratio
