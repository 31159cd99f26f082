"""Scans of a lidar that turns in one plane: an array of ranges for each stamp.

A table of numbers has a column for each value; a scan is one value. What a recording knows besides
(the sensor's angles, poses that stand beside the ranges, the odometry at the time of each scan)
stands beside the ranges. Only what was measured is here: where nothing came back, a range is NaN.

>>> scan = Scans("FLASER", np.array([0, 10**9]), np.array([[1.0, np.nan], [1.0, 2.0]]),
...              Lidar(start=-0.5, step=1.0, longest=50.0))
>>> scan.lidar.angles(2).tolist(), scan.rate
([-0.5, 0.5], 1.0)
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from evertwin.types import Bools, Float64, Int64, Stamps, Vector

EVENLY, UNEVEN, REGULAR, FAR_OFF = 20, 0.25, 0.95, 10
"""Of rows out of order: fewest that tell; by how much of the usual a step may differ, which share
of the steps does not; how many rows one may be off."""
OFTEN = 1e-3
"""Share of all ranges that the largest one must have to be no measurement."""
CODES = 0.9
"""Of the largest range: from there on others may be none, too."""
Poses = Float64[np.ndarray, "n 3"]
"""x, y [m] and heading [rad] for each stamp; NaN where there is none."""


@dataclass(frozen=True)
class Lidar:
    """Where the beams look.

    >>> Lidar(start=0.0, step=0.1, longest=10.0).angles(3).tolist()
    [0.0, 0.1, 0.2]
    """

    start: float
    """Angle of the first beam [rad], 0 ahead, left is positive."""
    step: float
    """Angle from beam to beam [rad]."""
    longest: float
    """From this range on nothing came back [m]."""
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it is on the machine: x, y [m], heading [rad]."""
    sweep: float = 0.0
    """Time from beam to beam [s]; 0: all at once, or not known."""

    @classmethod
    def ahead(cls, beams: int, step: float, longest: float) -> Lidar:
        """One that looks as far to the left as to the right; of a whole turn, or half of one, the
        last beam is left out.

        >>> [round(Lidar.ahead(n, math.radians(1), 9.0).start, 2) for n in (180, 181, 270, 360)]
        [-1.57, -1.57, -2.35, -3.14]
        """
        turns = beams * step / math.pi
        middle = beams // 2 if abs(turns - round(turns)) < 1e-6 else 0.5 * (beams - 1)
        return cls(-step * middle, step, longest)

    def angles(self, beams: int) -> Vector:
        """Of each beam [rad]."""
        return self.start + self.step * np.arange(beams)


class Track(NamedTuple):
    """What a sensor of motion said, by its stamps.

    >>> Track("/odom", np.array([0]), np.array([2]), np.zeros((1, 3))).name
    '/odom'
    """

    name: str
    t: Stamps
    """Strictly increasing [ns]."""
    arrived: Stamps
    """When each was logged, by the same clock [ns]."""
    values: Float64[np.ndarray, "m _"]
    """x, y [m], heading [rad] of odometry; turn rate [rad/s] of a gyro."""


@dataclass(frozen=True)
class Scans:
    """Scans of one lidar, in the order of recording.

    >>> Scans("scan", np.zeros(0, np.int64), np.zeros((0, 4)), Lidar(0.0, 0.1, 10.0)).timed
    True
    """

    name: str
    t: Stamps
    """Strictly increasing [ns]; see `timed`."""
    ranges: Float64[np.ndarray, "n beams"]
    """[m]; NaN where nothing came back."""
    lidar: Lidar
    odometry: Poses | None = None
    """Of the wheels, at each scan; None: the recording has none that can be relied on."""
    stated: Poses | None = None
    """The lidar's poses as the recording states them, by whatever method: for scoring alone."""
    timed: bool = True
    """False: the recording's stamps tell no time; they count scans, a second each."""
    findings: tuple[str, ...] = field(default=())
    """What is odd about them, as sentences."""
    wheels: Track | None = None
    """The odometry itself, where its own stamps are known."""
    gyro: Track | None = None
    """Turn rates about the vertical axis."""
    arrived: Stamps | None = None
    """When each scan was logged, by the clock of `t`."""
    assumed: str = ""
    """What was taken for the beams' angles, as a sentence; empty: the recording says them."""
    handed: bool = False
    """Does the format itself fix which way the beams run, and that poses are the lidar's?"""

    @property
    def rate(self) -> float:
        """Scans per second, from the median step; NaN for one."""
        return 1e9 / float(np.median(np.diff(self.t))) if len(self.t) > 1 else float("nan")


def increasing(t: Stamps) -> Bools:
    """The most stamps that increase strictly in the order given; the others are wrong.

    >>> increasing(np.array([1, 2, 9, 3, 4, 4])).tolist()
    [True, True, False, True, True, False]
    """
    tails: list[int] = []
    places: list[int] = []
    before = np.full(len(t), -1)
    for i, value in enumerate(t.tolist()):
        k = bisect_left(tails, value)
        if tails[k : k + 1] == [value]:
            continue
        before[i] = places[k - 1] if k else -1
        tails[k : k + 1], places[k : k + 1] = [value], [i]
    keep = np.zeros(len(t), dtype=np.bool_)
    i = places[-1] if places else -1
    while i >= 0:
        keep[i], i = True, int(before[i])
    return keep


def shuffled(t: Stamps) -> Int64[np.ndarray, " n"] | None:
    """The order of rows that stand out of order, though their stamps are right; None: they do not.

    Their stamps then follow each other evenly once they are sorted, and no row is far off.

    >>> t = np.arange(30) * 10
    >>> t[[4, 5]] = t[[5, 4]]
    >>> order = shuffled(t)
    >>> t[order].tolist() == sorted(t.tolist()), shuffled(np.sort(t)) is None
    (True, True)
    """
    steps = np.diff(t)
    if len(t) < EVENLY or (steps > 0).all():
        return None
    order = np.argsort(t, kind="stable").astype(np.int64)
    steps = np.diff(t[order])
    even = np.abs(steps - np.median(steps)) < UNEVEN * np.median(steps)
    far = int(np.abs(order - np.arange(len(t))).max())
    return order if (steps > 0).all() and even.mean() >= REGULAR and far <= FAR_OFF else None


def mended(t: Stamps) -> tuple[Stamps, Bools]:
    """Strictly increasing stamps, and which of ``t`` are kept; the order of the rows is believed.

    A stamp that goes back or repeats is placed between its neighbours. Where fewer than half
    increase, none is kept: rows are then counted, a second each.

    >>> mended(np.array([0, 100, 50, 200]))[0].tolist()
    [0, 25, 50, 200]
    >>> mended(np.zeros(3, np.int64))[0].tolist()
    [0, 1000000000, 2000000000]
    """
    keep = increasing(t)
    count = np.arange(len(t), dtype=np.int64)
    if len(t) == 1:
        return t, keep
    if 2 * keep.sum() < len(t) or keep.sum() < 2:
        return count * 10**9, np.zeros(len(t), dtype=np.bool_)
    first, rows, known = int(t[keep][0]), count[keep], t[keep] - t[keep][0]
    between = np.interp(count, rows, known.astype(np.float64))
    step = max(int(np.median(np.diff(known))), 1)
    between += step * (np.minimum(count - rows[0], 0) + np.maximum(count - rows[-1], 0))
    out = np.where(keep, t, first + np.rint(between).astype(np.int64))
    return (out, keep) if np.all(np.diff(out) > 0) else (count * 10**9, np.zeros_like(keep))


def at_stamps(
    t: Stamps, known: Int64[np.ndarray, " m"], poses: Float64[np.ndarray, "m 3"]
) -> Poses:
    """Poses between the known ones at ``t`` (a straight line); NaN before and after them all."""
    at, base = (t - known[0]) * 1e-9, (known - known[0]) * 1e-9
    whole = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    return np.column_stack([np.interp(at, base, c, np.nan, np.nan) for c in whole.T])


def ceiling(ranges: np.ndarray) -> float:
    """The lowest of the codes that say that nothing came back; infinity without any.

    A code is the largest range of all but a few, shared by many, and it stands apart or outnumbers
    those below; a lidar may have several, for what it did not see and why.

    >>> ceiling(np.array([[1.0, 2.0, 30.0], [1.5, 2.5, 30.0]]))
    30.0
    >>> ceiling(np.array([[1.0, 2.0, 8.183], [1.5, 8.191, 8.183], [3.0, 8.183, 8.191]]))
    8.183
    """
    values, counts = np.unique(ranges[np.isfinite(ranges)], return_counts=True)
    found, above = math.inf, 0
    for k in range(len(values) - 1, 0, -1):
        if values[k] < CODES * values[-1]:
            break
        apart = (
            values[k] > 1.1 * values[k - 1] or counts[k] > 10 * counts[max(k - 10, 0) : k].mean()
        )
        if apart and counts[k] >= max(OFTEN * ranges.size, above):
            found, above = float(values[k]), 0
        else:
            above += int(counts[k])
    return found
