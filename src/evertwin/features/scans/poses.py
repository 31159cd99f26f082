"""Poses from scans, with where each comes from and how far it can be trusted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from evertwin.features.scans.fusion import Sighting
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


class Row(NamedTuple):
    """What a scan tells; see `Poses`.

    >>> Row().fix.name
    'LOST'
    """

    pose: Float64[np.ndarray, " 3"] = np.full(3, np.nan)
    covariance: Float64[np.ndarray, "3 3"] = np.full((3, 3), np.nan)
    fix: Fix = Fix.LOST
    share: float = 0.0
    segment: int = 0
    sighting: Sighting = Sighting(np.full(3, np.nan), np.zeros((3, 3)))
    slip: bool = False
    scale: float = math.nan


def table(rows: Sequence[tuple[int, Row, bool]]) -> Poses:
    """Stamps [ns], rows, and whether their scans joined the map, as poses."""
    t, told, keyframe = zip(*rows, strict=True)
    pose, covariance, fix, share, segment, sighting, slip, scale = zip(*told, strict=True)
    return Poses(
        np.array(t), np.array(pose), np.array(covariance), np.array(fix, np.uint8),
        np.array(share), np.array(keyframe, np.uint8), np.array(segment),
        np.array([one.pose for one in sighting]), np.array([one.information for one in sighting]),
        np.array(slip, np.uint8), np.array(scale),
    )  # fmt: skip
