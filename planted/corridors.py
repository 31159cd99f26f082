"""A robot that drives through a bare corridor, seen by a lidar that reaches no end of it."""

from __future__ import annotations

import numpy as np

from evertwin.sources.columns.scans import Lidar, Scans

ANGLES = np.radians(np.arange(-180, 180, 0.36))
HALF, LONG = 1.0, 40.0
"""Of the corridor [m]."""
WAY = np.arange(4.5, 35.5, 0.1)
"""Where a scan is taken, 5 a second [m]."""


def corridor(x: float, noisy: np.random.Generator, reach: float) -> np.ndarray:
    """What a lidar at ``x`` of it sees, in whole centimetres."""
    c, s = np.cos(ANGLES), np.sin(ANGLES)
    with np.errstate(divide="ignore"):
        far = np.minimum(HALF / np.abs(s), np.where(c > 0, LONG - x, x) / np.abs(c))
    seen = np.round(far + noisy.normal(0, 0.02, len(far)), 2)
    return np.where(far < reach, seen, np.nan)


def scanned(x: np.ndarray, seed: int, wheels: np.ndarray | None = None) -> Scans:
    """Along ``x``, with what the wheels tell."""
    rng = np.random.default_rng(seed)
    ranges = np.array([corridor(v, rng, 4.0) for v in x])
    t = np.arange(len(x), dtype=np.int64) * 2 * 10**8
    lidar = Lidar(float(ANGLES[0]), float(np.radians(0.36)), 4.0)
    return Scans("scan", t, ranges, lidar, odometry=wheels)


def driven(seed: int) -> Scans:
    """By wheels that tell 2 % too much."""
    way = np.column_stack([1.02 * (WAY - WAY[0]), np.zeros(len(WAY)), np.zeros(len(WAY))])
    return scanned(WAY, seed, way)
