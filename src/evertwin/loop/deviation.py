"""How far predictions were from measurements, from sums over rows.

>>> sums = Sums(np.array([0.01]), np.array([4.0]), np.array([1]))
>>> deviation(sums, relative=True).round(3).tolist()
[0.05]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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


def deviation(sums: Sums, relative: bool) -> Vector:
    """Rms of the residual per output, relative to the measurement's or not; NaN without rows."""
    count = np.where(sums.samples > 0, sums.samples, np.nan)
    base = sums.measured if relative else count
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: Vector = np.sqrt(sums.residual / np.where(sums.samples > 0, base, np.nan))
    return ratio
