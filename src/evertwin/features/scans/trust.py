"""A gyro that is turned round, wheels that stand, a lidar that repeats itself: named, and left out.

Which of the three it is tells `evertwin.features.scans.voting`, so all three must be there.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from evertwin.features.scans.motion import summed, turned_at
from evertwin.features.scans.poses import Fix, Poses
from evertwin.features.scans.surface import noise
from evertwin.features.scans.voting import FEW, TELLS, apart, outvoted, steady, turned
from evertwin.sources.columns.scans import Scans, Track
from evertwin.types import Float64, Stamps, Vector

STEP = 10**9
"""Time between what is compared [ns]."""
HELD = 2 * 10**9
"""How long scans may say no turn until nothing is known of it [ns]."""
REPEATS = 3.0
"""How far a range may be off those of a lidar that repeats itself, as a multiple of its usual."""
JITTERS = 0.05
"""The same usual, at most [m]."""
NOISY, WENT, SOME = 0.5, 0.1, 50
"""Middle difference of ranges that are one, over their noise: of two scans of a place it is 0.95;
way or turn of the wheels meanwhile [m, rad]; scans that tell the noise."""
WHO = ("the wheels turn", "the gyro turns", "the scans turn")
OTHERS = ("gyro and scans", "wheels and scans", "wheels and gyro")


def doubtful(scans: Scans) -> bool:
    """Do wheels and gyro contradict each other?"""
    times = _times(scans)
    if len(times) < FEW:
        return False
    (wheels, gyro), ends = _motion(scans, times), 1e-9 * (times - times[0])
    return bool((apart(ends, steady(ends, gyro, wheels), wheels) > 1).sum() >= FEW)


def trusted(scans: Scans, poses: Poses) -> tuple[Scans, list[str]]:
    """Without what two others outvote, and sentences about it.

    Args:
        scans: of a recording.
        poses: by the scans; NaN where they tell none.
    """
    times = _times(scans)
    if len(times) < FEW:
        return scans, []
    ends = 1e-9 * (times - times[0])
    wheels, gyro, seen = *_motion(scans, times), _seen(poses, times)
    angles = np.column_stack([wheels, steady(ends, gyro, wheels, seen), seen])
    said = []
    for who, start, end in outvoted(ends, angles):
        begin = int(times[0] + 1e9 * start) if start > ends[0] else 0
        last = int(times[0] + 1e9 * end) if end < ends[-1] else int(np.iinfo(np.int64).max)
        within = np.flatnonzero((scans.t >= begin) & (scans.t <= last))
        if who == 2:
            within = repeated(scans.ranges, within)
        if not len(within):
            continue
        where = f"scans {within[0]} to {within[-1]}"
        if who == 2:
            said.append(f"{where} repeat one another while wheels and gyro turn: a frozen lidar; "
                        "left out")  # fmt: skip
            ranges = scans.ranges.copy()
            ranges[within] = np.nan
            scans = replace(scans, ranges=ranges)
            continue
        much = _factor(ends, angles, who, (start, end))
        said.append(f"{where}: {WHO[who]} {much} {OTHERS[who]}, which agree: left out")
        scans = _without(scans, who, begin, last)
    return scans, said


def repeated(ranges: Float64[np.ndarray, "n beams"], within: np.ndarray) -> np.ndarray:
    """The scans around some that repeat these, but for noise; none where these differ.

    >>> rng = np.random.default_rng(0)
    >>> seen = 2 + np.cumsum(rng.normal(size=(30, 40)), axis=0)
    >>> seen[10:20] = seen[10] + 0.002 * rng.normal(size=(10, 40))
    >>> repeated(seen, np.arange(12, 22)).tolist()
    [10, 11, 12, 13, 14, 15, 16, 17, 18, 19]
    """
    if not len(within):
        return within
    with np.errstate(invalid="ignore"):
        middle = ranges[within[len(within) // 2]]
        off = np.nanmedian(np.abs(ranges - middle), axis=1)
        usual = float(np.median(off[within]))
        alike = off <= max(REPEATS * usual, 1e-6)
    if usual > JITTERS or not alike[within].any():
        return within[:0]
    at = int(within[len(within) // 2])
    edges = np.flatnonzero(~alike)
    first = edges[edges < at].max(initial=-1) + 1
    last = edges[edges > at].min(initial=len(ranges))
    return np.arange(first, last)


def without_repeats(scans: Scans) -> Scans:
    """Without scans that repeat one before, but for less than their noise, while the wheels go on.

    A machine that stands while its wheels spin sees all of the noise anew; a lidar that is frozen
    says the same again, whatever is added to it on the way.
    """
    wheels, ranges = scans.odometry, scans.ranges
    sigma = float(np.median([noise(one) for one in ranges[:: max(len(ranges) // SOME, 1)]]))
    if wheels is None or not sigma:
        return scans
    out, said, i = ranges.copy(), [], 0
    while i < len(ranges) - 1:
        j = i
        while j + 1 < len(ranges) and _off(ranges[j + 1], ranges[i]) < NOISY * sigma:
            j += 1
        went = np.abs(wheels[i : j + 1] - wheels[i])
        if j > i and np.nanmax(went, initial=0.0) > WENT:
            out[i + 1 : j + 1] = np.nan
            said.append(f"scans {i} to {j} repeat one another by less than their noise while the "
                        "wheels go on: a frozen lidar; left out")  # fmt: skip
        i = max(j, i + 1)
    return replace(scans, ranges=out, findings=(*scans.findings, *said)) if said else scans


def _off(one: Vector, other: Vector) -> float:
    """By how much ranges differ, in the middle [m]."""
    off = np.abs(one - other)
    off = off[np.isfinite(off)]
    return float(np.median(off)) if len(off) else math.inf


def _times(scans: Scans) -> Stamps:
    if scans.odometry is None or scans.gyro is None or not scans.timed or len(scans.t) < 2:
        return np.zeros(0, np.int64)
    return np.arange(scans.t[0], scans.t[-1], STEP)


def _motion(scans: Scans, times: Stamps) -> tuple[Vector, Vector]:
    """Angles of wheels and gyro."""
    if scans.wheels is not None:
        t, heading = scans.wheels.t, scans.wheels.values[:, 2]
    else:
        assert scans.odometry is not None
        known = np.isfinite(scans.odometry[:, 2])
        t, heading = scans.t[known], scans.odometry[known, 2]
    steps = np.diff(np.unwrap(heading))
    return summed(t, steps, np.diff(t) <= HELD, times), turned_at(scans, times)


def _seen(poses: Poses, times: Stamps) -> Vector:
    """The angle by the scans."""
    k = np.flatnonzero(poses.fix == Fix.MATCHED)
    if len(k) < 2:
        return np.full(len(times), np.nan)
    t, told = poses.t[k], (np.diff(poses.segment[k]) == 0) & (np.diff(poses.t[k]) <= HELD)
    return summed(t, np.diff(poses.pose[k, 2]), told, times)


def _factor(ends: Vector, angles: np.ndarray, who: int, span: tuple[float, float]) -> str:
    """How many times as far one turned as the others do."""
    mine, other = turned(ends, angles[:, who]), turned(ends, angles[:, (who + 1) % 3])
    if not np.isfinite(other).any():
        other = turned(ends, angles[:, (who + 2) % 3])
    inside = (ends >= span[0]) & (ends <= span[1]) & (np.abs(other) > TELLS) & np.isfinite(mine)
    if inside.sum() < FEW:
        return "otherwise than"
    return f"{float(np.median(mine[inside] / other[inside])):.2g} times as far as"


def _without(scans: Scans, who: int, begin: int, last: int) -> Scans:
    """Without wheels or gyro from one time to another."""

    def left(one: Track | None) -> Track | None:
        if one is None:
            return None
        keep = (one.t < begin) | (one.t > last)
        kept = one._replace(t=one.t[keep], arrived=one.arrived[keep], values=one.values[keep])
        return kept if keep.sum() > 1 else None

    if who == 1:
        return replace(scans, gyro=left(scans.gyro))
    assert scans.odometry is not None
    inside = (scans.t >= begin) & (scans.t <= last)
    odometry = np.where(inside[:, None], np.nan, scans.odometry)
    told = bool(np.isfinite(odometry).any())
    return replace(scans, odometry=odometry if told else None, wheels=left(scans.wheels))
