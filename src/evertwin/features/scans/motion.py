"""What wheels and gyro say at the times of scans; nothing where they were silent.

>>> from evertwin.sources.columns.scans import Lidar, Track
>>> t, at = (np.array(one) * 10**8 for one in ([0, 1, 2, 16, 17, 18], [0, 2, 8, 16, 18]))
>>> gyro = Track("/imu", t, t, np.ones((6, 1)))
>>> scans = Scans("scan", at, np.ones((5, 4)), Lidar(0.0, 0.1, 9.0), gyro=gyro)
>>> turned_at(scans, scans.t).round(1).tolist()
[0.0, 0.2, nan, 0.2, 0.4]
"""

from __future__ import annotations

import numpy as np

from evertwin.sources.columns.scans import Scans
from evertwin.types import Bool, Float64, Int64, Stamps, Vector

SILENT, LEAST = 10.0, 3 * 10**8
"""Usual steps in a row that are missing, and time at least [ns], where a sensor was silent."""


def silence(t: Stamps) -> int:
    """How long a sensor is silent that is no longer heard [ns]."""
    return max(int(SILENT * np.median(np.diff(t))), LEAST) if len(t) > 1 else LEAST


def motion_at(scans: Scans) -> Float64[np.ndarray, "n _"]:
    """The wheels' pose at each scan, and the gyro's angle; no column where there is neither."""
    n = len(scans.t)
    wheels = np.full((n, 3), np.nan) if scans.odometry is None else scans.odometry
    if scans.gyro is None:
        return np.zeros((n, 0)) if scans.odometry is None else wheels
    return np.column_stack([wheels, turned_at(scans, scans.t)])


def turned_at(scans: Scans, t: Stamps) -> Vector:
    """The gyro's angle at some times [rad]; NaN without one, and while it was silent."""
    if scans.gyro is None:
        return np.full(len(t), np.nan)
    known, rate = scans.gyro.t, scans.gyro.values[:, 0]
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(known) * 1e-9
    return summed(known, steps, np.diff(known) <= silence(known), t)


def summed(
    known: Int64[np.ndarray, " known"],
    steps: Float64[np.ndarray, " steps"],
    told: Bool[np.ndarray, " steps"],
    t: Int64[np.ndarray, " asked"],
) -> Float64[np.ndarray, " asked"]:
    """The sum of steps between ``known`` times, at ``t``; NaN within those not ``told``."""
    whole = np.concatenate([[0.0], np.cumsum(np.where(told, steps, 0.0))])
    at, base = (t - known[0]) * 1e-9, (known - known[0]) * 1e-9
    out = np.interp(at, base, whole, np.nan, np.nan)
    k = np.clip(np.searchsorted(known, t, side="right") - 1, 0, max(len(steps) - 1, 0))
    inside = (t > known[k]) & (t < known[np.minimum(k + 1, len(known) - 1)])
    return np.where(inside & ~told[k], np.nan, out) if len(steps) else out
