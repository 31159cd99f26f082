"""When the wheels slipped, and by how much: named from what the filter was told by its innovations.

>>> went = np.column_stack([np.arange(6.0), np.zeros(6), np.zeros(6)])
>>> scale = np.array([1.0, 1.0, 0.6, 0.6, 1.0, 1.0])
>>> flags = np.array([0, 0, 1, 0, 1, 0])
>>> poses = np.column_stack([np.r_[0, np.cumsum(scale[1:])], np.zeros(6), np.zeros(6)])
>>> [(one.start, one.end, one.wheels, round(one.scans, 1)) for one in slips(
...     np.arange(6), poses, went, (flags, scale))]
[(1, 3, 2.0, 1.2)]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.types import Float64, Stamps

APART = 0.1
"""Share by which the scale of the way is off its usual value while the wheels slip."""
LEAST = 0.03
"""Ways that differ by less are no slip [m]."""


class Slip(NamedTuple):
    """The wheels turned, and the machine went another way.

    >>> Slip(0, 10**9, 0.5, 0.3).wheels
    0.5
    """

    start: int
    end: int
    """[ns]"""
    wheels: float
    scans: float
    """Way by each [m]."""


def slips(
    t: Stamps,
    poses: Float64[np.ndarray, "n 3"],
    wheels: Float64[np.ndarray, "n 3"],
    told: tuple[np.ndarray, np.ndarray],
) -> list[Slip]:
    """Stretches in which the wheels slipped.

    Args:
        t: of each scan.
        poses: by the scans; NaN where there is none.
        wheels: poses of the wheels.
        told: of each scan, whether its innovation named slip, and the scale of the way.
    """
    flags, scale = told
    known = np.isfinite(scale)
    if not known.any():
        return []
    usual = float(np.median(scale[known]))
    odd = known & (np.abs(scale / usual - 1) > APART)
    found, i = [], 1
    while i < len(t):
        if flags[i] and odd[i]:
            j = i
            while j + 1 < len(t) and (odd[j + 1] or not known[j + 1]):
                j += 1
            found += _slip(t, poses, wheels, (i - 1, j))
            i = j
        i += 1
    return found


def _slip(t: Stamps, poses: np.ndarray, wheels: np.ndarray, ends: tuple[int, int]) -> list[Slip]:
    i, j = ends
    by = [float(np.nansum(np.hypot(*np.diff(p[i : j + 1, :2], axis=0).T))) for p in (wheels, poses)]
    return [Slip(int(t[i]), int(t[j]), *by)] if abs(by[0] - by[1]) > LEAST else []
