"""Does a position stand all the while, whatever its measured speed says?

Noise that is added to a position vanishes in its course, and that of a speed in the way that it
tells: what stands goes nowhere beyond what it changes by from one row to the next.

>>> rng, t = np.random.default_rng(0), 0.01 * np.arange(500)
>>> noise = rng.normal(0.0, 0.02, 500)
>>> stands(np.full(500, 1.5), noise, 0.01), stands(1.5 + 0.1 * np.sin(t), noise, 0.01)
(True, False)
"""

from __future__ import annotations

import numpy as np

from evertwin.types import Float64

LEAST = 30
"""Rows that tell."""


def stands(
    position: Float64[np.ndarray, " n"], speed: Float64[np.ndarray, " n"], dt: float
) -> bool:
    """Is all that a position does noise of its own, or less than its speed says of one row?

    Args:
        position: NaN where it is not known.
        speed: of it, in its unit per second.
        dt: usual time from row to row [s].
    """
    known = np.isfinite(position) & np.isfinite(speed)
    q, v = position[known], speed[known]
    if len(q) < LEAST:
        return False
    in_a_row = max(float(np.mean(np.square(np.diff(q)))), float(np.mean(np.square(v))) * dt**2)
    rounding = 4.0 * np.finfo(np.float64).eps * float(np.abs(q).max())
    return bool(np.var(q) <= in_a_row + rounding**2)
