"""Compiled: what goes on with what was before, for `evertwin.sync.alignment.derive`."""

from __future__ import annotations

import math

from evertwin.compiled.functions import njit
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.types import Vector


@njit(cache=True, error_model="numpy")
def unwrapped(angle: float, sums: Vector) -> float:
    """The angle without its wraps: it turns by less than half a turn from row to row."""
    if angle != angle:
        return math.nan
    sums[1] = angle if sums[0] == 0.0 else sums[1] + wrapped(angle - sums[1], True)
    sums[0] = 1.0
    return float(sums[1])


@njit(cache=True, error_model="numpy")
def lagging(x: float, passed: float, sums: Vector) -> float:
    """Behind a first-order low pass, ``passed`` time constants after the row before; it begins at
    its input, where that is infinite."""
    if x != x:
        return math.nan
    sums[1] = x if sums[0] == 0.0 else x + (sums[1] - x) * math.exp(-passed)
    sums[0] = 1.0
    return float(sums[1])
