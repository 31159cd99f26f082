"""Poses from scans, with where each comes from and how far it can be trusted."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from evertwin.types import Float64, Int64, Stamps, UInt8


class Fix(IntEnum):
    """Where a pose comes from.

    >>> Fix.MATCHED.name
    'MATCHED'
    """

    LOST = 0
    """There is none."""
    PREDICTED = 1
    """From odometry alone: the scan tells too little."""
    MATCHED = 2
    """From the scan."""


class Poses(NamedTuple):
    """A pose for each scan; NaN where the robot is lost.

    >>> Poses._fields[:3]
    ('t', 'pose', 'covariance')
    """

    t: Stamps
    pose: Float64[np.ndarray, "n 3"]
    """x, y [m], heading [rad, not wrapped]."""
    covariance: Float64[np.ndarray, "n 3 3"]
    """Within the local map."""
    fix: UInt8[np.ndarray, " n"]
    """`Fix` of each."""
    share: Float64[np.ndarray, " n"]
    """Of the scan's wall points that lie beside a wall of the map."""
    keyframe: UInt8[np.ndarray, " n"]
    """1 where the scan joined the map."""
    segment: Int64[np.ndarray, " n"]
    """Number of the map that the pose is told in."""
    sighted: Float64[np.ndarray, "n 3"]
    """Poses by the scans alone, in the frame of the local map."""
    information: Float64[np.ndarray, "n 3 3"]
    """About them: singular where a scan leaves a direction open. Of the first of a segment: about
    its place in the one before."""
    slip: UInt8[np.ndarray, " n"]
    """1 where the wheels went out of all proportion to the scans."""
    scale: Float64[np.ndarray, " n"]
    """Way of the machine over that of its wheels."""
