"""Does a scan contradict the map? Its beams pass through walls that the map holds.

Somebody in between shortens a beam, a place not yet seen is in no map: both are no contradiction. A
beam that ends behind a known wall is: the robot is not where it is believed to be.

>>> ahead = np.array([[2.0, y, -1.0, 0.0] for y in np.arange(-0.5, 0.5, 0.05)])
>>> angles = np.radians(np.arange(-10, 11, 1.0))
>>> [contradicted(np.full(21, r), angles, np.zeros(3), ahead) for r in (2.0, 1.0, 3.0)]
[0.0, 0.0, 1.0]
"""

from __future__ import annotations

import numpy as np

from evertwin.features.scans.local_map import Surface, placed
from evertwin.types import Float64, Vector

BEHIND = 0.25
"""How far behind a wall a beam must end, across it [m]."""
BESIDE = 0.15
"""How near to it a beam ends that sees it [m]."""
FEW = 10
"""Beams that must tell."""


def contradicted(
    ranges: Vector, angles: Vector, lidar: Float64[np.ndarray, " 3"], points: Surface
) -> float:
    """Share of the beams towards known walls that pass through them; 0 where few tell.

    Args:
        ranges: of each beam [m]; NaN where nothing came back.
        angles: of each beam [rad].
        lidar: its pose in the map.
        points: of the map.
    """
    c, s = np.cos(lidar[2]), np.sin(lidar[2])
    home = np.array([-c * lidar[0] - s * lidar[1], s * lidar[0] - c * lidar[1], -lidar[2]])
    x, y, nx, ny = placed(points, home).T
    far = np.hypot(x, y)
    facing = -(nx * x + ny * y) / np.maximum(far, 1e-9)  # cosine to the wall's normal
    step = angles[1] - angles[0]
    turn = (np.arctan2(y, x) - angles[0] + np.pi * np.sign(step)) % (2 * np.pi * np.sign(step))
    beam = np.rint((turn - np.pi * np.sign(step)) / step).astype(np.int64)
    whole = round(abs(2 * np.pi / step))
    beam = np.where(beam < 0, beam + whole, beam)
    seen = (facing > 0.3) & (beam >= 0) & (beam < len(ranges))
    nearest, across = np.full(len(ranges), np.inf), np.ones(len(ranges))
    order = np.flatnonzero(seen)[np.argsort(-far[seen], kind="stable")]
    nearest[beam[order]], across[beam[order]] = far[order], facing[order]  # the nearest comes last
    with np.errstate(invalid="ignore"):
        off = (ranges - nearest) * across
        through = int((off > BEHIND).sum())
        met = int((np.abs(off) < BESIDE).sum())
    return through / (through + met) if through + met >= FEW else 0.0
