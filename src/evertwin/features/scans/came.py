"""A scan as it comes, with what wheels and gyro said by then."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.fold import Block
from evertwin.types import Float64, Vector

Motion = Float64[np.ndarray, " 4"]
"""Wheels' pose and gyro's angle; NaN where they are not known."""


class Came(NamedTuple):
    """A scan, and what wheels and gyro said by then.

    >>> Came(np.ones(3), np.full(4, np.nan), 0.1).dt
    0.1
    """

    ranges: Vector
    """[m]"""
    moved: Motion
    dt: float
    """Since the scan before [s]."""

    @classmethod
    def of(cls, block: Block, i: int) -> Came:
        """The ``i``-th of a block."""
        moved = np.full(4, np.nan)
        moved[: block.u.shape[1]] = block.u[i]
        return cls(block.y[i], moved, float(block.dt[i]))
