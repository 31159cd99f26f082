"""Arms and their motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.machines.arm.rnea import KEPT, joint_torques


def row_by_row(geometry: np.ndarray, inertia: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Joint torques of a chain by the recursion of one sample, (rows, 3 n) to (rows, n)."""
    n = u.shape[1] // 3
    out, kept = np.empty((len(u), n)), np.empty(KEPT * n)
    for row, tau in zip(u, out, strict=True):
        joint_torques(n, geometry, inertia, row, tau, kept)
    return out


def table(rng: np.random.Generator, n: int, slides: int | None = None) -> list[dict[str, Any]]:
    """A random arm: half-metre links of one to ten kilograms; one joint slides (the middle one)."""
    slides = n // 2 if slides is None else slides
    rows = []
    for i in range(n):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        own = turn @ np.diag(rng.uniform(0.02, 0.03, 3)) @ turn.T
        rows.append({
            "a": rng.uniform(-0.5, 0.5), "alpha": rng.uniform(-2, 2), "d": rng.uniform(-0.3, 0.3),
            "theta": rng.uniform(-2, 2), "kind": "prismatic" if i == slides else "revolute",
            "mass": rng.uniform(1, 10), "com": rng.uniform(-0.2, 0.2, 3).tolist(),
            "inertia": [*np.diag(own).tolist(), own[0, 1], own[0, 2], own[1, 2]],
        })  # fmt: skip
    return rows
