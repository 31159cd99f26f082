"""Arms and their motion."""

from __future__ import annotations

import numpy as np

from evertwin.machines.arm.rnea import joint_torques


def row_by_row(geometry: np.ndarray, inertia: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Joint torques of a chain by the recursion of one sample, (rows, 3 n) to (rows, n)."""
    n = u.shape[1] // 3
    out, kept = np.empty((len(u), n)), np.empty(8 * n)
    for row, tau in zip(u, out, strict=True):
        joint_torques(n, geometry, inertia, row, tau, kept)
    return out
