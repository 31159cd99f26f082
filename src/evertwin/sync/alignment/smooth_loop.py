"""Compiled: what is computed of a window of rows: a slope, a symmetric filter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.types import Vector

if TYPE_CHECKING:
    from evertwin.sync.alignment.derive_loop import Lines


@njit(cache=True, error_model="numpy")
def slope(ring: Lines, base: int, c: int, j: int, n: int, weights: Vector, h: int) -> float:
    """Derivative of the polynomial over the window around row j, whole windows alone."""
    depth, size = ring.t.shape[0], 2 * h + 1
    if n < size:
        return np.nan
    first = min(max(j - h, 0), n - size)
    place = j - first
    total = 0.0
    for k in range(size):
        value = ring.v[(base + first + k) % depth, c]
        if place <= h:
            total += weights[place * size + k] * value
        else:
            total -= weights[(size - 1 - place) * size + size - 1 - k] * value
    return total


@njit(cache=True, error_model="numpy")
def filtered(ring: Lines, base: int, c: int, j: int, n: int, weights: Vector, h: int) -> float:
    """Symmetric filter at row j; beyond an end the stretch goes on as its point reflection."""
    depth = ring.t.shape[0]
    first, last = ring.v[base % depth, c], ring.v[(base + n - 1) % depth, c]
    total = weights[0] * ring.v[(base + j) % depth, c]
    for k in range(1, h + 1):
        low, high = j - k, j + k
        if low >= 0:
            before = ring.v[(base + low) % depth, c]
        else:
            before = 2.0 * first - ring.v[(base + min(-low, n - 1)) % depth, c]
        if high < n:
            after = ring.v[(base + high) % depth, c]
        else:
            after = 2.0 * last - ring.v[(base + max(2 * (n - 1) - high, 0)) % depth, c]
        total += weights[k] * (before + after)
    return float(total)
