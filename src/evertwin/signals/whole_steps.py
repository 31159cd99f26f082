"""Commands that a machine takes in whole steps only, such as ticks of an encoder in a period."""

from __future__ import annotations

import numpy as np

from evertwin.types import Float64

WRITTEN = 1e-6
"""Share by which a command as a file writes it may lie below a whole step."""


def whole_steps(
    values: Float64[np.ndarray, "..."], step: float | Float64[np.ndarray, "..."]
) -> Float64[np.ndarray, "..."]:
    """What the machine takes of values: whole steps, cut towards 0; all of them where a step is 0.

    >>> whole_steps(np.array([28.2743, 2.8, -3.0]), 2.82743).round(3).tolist()
    [28.274, 0.0, -2.827]
    """
    size = np.asarray(step, dtype=np.float64)
    if not size.any():
        return values
    steps = np.trunc(values / np.where(size > 0.0, size, 1.0) * (1.0 + WRITTEN))
    return np.where(size > 0.0, steps * size, values)
