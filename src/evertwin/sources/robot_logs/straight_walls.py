"""How far apart a lidar's beams are, told by walls: they are straight at the right angle alone.

Along a wall the inverse range is a wave in the beam's angle, 1/r = a cos φ + b sin φ. Stretches of
scans that are one at some step are walls; the step at which they are straightest together is the
lidar's. Ranges of another scale say the same.

>>> step, seen = math.radians(1.0), []
>>> for turn in np.linspace(0, 1, 60):
...     angles = turn + step * np.arange(180)
...     seen.append(np.min([np.where((c := np.cos(angles - k)) > 0.05, 3 / c, np.inf)
...                         for k in (0, math.pi / 2, math.pi)], axis=0))
>>> told = beam_step(np.array(seen), math.radians(0.7))
>>> round(math.degrees(told), 2)
1.0
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from evertwin.types import Float64, Vector

SCANS, BEAMS = 200, 180
"""That are looked at, about."""
SHORT, LONG = 10, math.radians(45.0)
"""Part of a scan that is a stretch at first [1/scan], then with the step roughly known [rad]."""
WIDE = np.exp(np.linspace(math.log(0.35), math.log(3.0), 87))
NARROW = np.exp(np.linspace(-0.08, 0.08, 81))
"""Factors on the step that are tried."""
STRAIGHT, LEAST = 0.03, 0.005
"""Off the wall that is fitted, up to which a stretch is one, and at least [m]."""
FEW, WHOLE = 30, 0.9
"""Stretches that must tell; share of the beams of one that come back."""
OTHER, CLEARLY = 0.02, 30.0
"""Share by which any step must be off, and logarithm of how much likelier it must be."""
NEAR, LIKELIER = 0.2, 10.0
"""The same of one of a few: how near to the best of all it must be."""


def beam_step(
    ranges: Float64[np.ndarray, "n beams"], step: float, among: Sequence[float] = ()
) -> float:
    """The step from beam to beam that walls tell [rad]: ``step`` where they do not clearly tell
    another.

    Args:
        ranges: [m], NaN where nothing came back.
        step: what is taken for it [rad].
        among: what it may be besides; empty: anything.
    """
    apart = max(ranges.shape[1] // BEAMS, 1)
    some, stated = ranges[:: max(len(ranges) // SCANS, 1), ::apart], apart * abs(step)
    short, sign = some.shape[1] // SHORT, math.copysign(1 / apart, step)
    rough, better = _best(some, np.append(stated * WIDE, stated), short)
    if not stated * WIDE[0] < rough < stated * WIDE[-1]:  # a round room: all of its walls are bent
        return step
    if len(among):
        told, better = _best(some, np.array([*(apart * abs(one) for one in among), stated]), short)
        return sign * told if better > LIKELIER and abs(told / rough - 1) < NEAR else step
    fine, than = _best(some, np.append(rough * NARROW, stated), round(LONG / rough))
    told, better = (fine, than) if than else (rough, better)
    return sign * told if better > CLEARLY and abs(told / stated - 1) > OTHER else step


def _best(ranges: np.ndarray, steps: Vector, long: int) -> tuple[float, float]:
    """The step at which stretches of so many beams are straightest, and logarithm of how much
    likelier it is than the last; 0: too few are straight."""
    half = max(min(long, ranges.shape[1] // 2) // 2, 4)
    if ranges.shape[1] <= 2 * half:
        return float(steps[-1]), 0.0
    views = np.lib.stride_tricks.sliding_window_view(ranges, 2 * half + 1, axis=1)[:, ::half]
    found = views.reshape(-1, 2 * half + 1)
    found = found[np.isfinite(found).mean(axis=1) > WHOLE]
    off = np.array([_off(found, step) for step in steps])
    least = off.min(axis=0, initial=math.inf)
    walls = least < STRAIGHT
    if walls.sum() < FEW:
        return float(steps[-1]), 0.0
    usual = max(float(np.median(least[walls])), LEAST)
    cost = np.log1p(0.5 * (off[:, walls] / usual) ** 2).sum(axis=1)
    return float(steps[cost.argmin()]), float(cost[-1] - cost.min())


def _off(stretches: np.ndarray, step: float) -> Vector:
    """How far stretches are off the walls that fit them best (rms) [m], beams ``step`` apart."""
    there = np.isfinite(stretches)
    inverse = 1 / np.where(there, stretches, 1.0)
    weight = np.where(there, inverse**-4, 0.0)  # an error of 1/r, as one of the range
    angle = step * (np.arange(stretches.shape[1]) - stretches.shape[1] // 2)
    c, s = np.cos(angle), np.sin(angle)
    cc, cs, ss = weight @ (c * c), weight @ (c * s), weight @ (s * s)
    cu, su = (weight * inverse) @ c, (weight * inverse) @ s
    det = cc * ss - cs * cs
    a, b = (cu * ss - su * cs) / det, (su * cc - cu * cs) / det
    error = weight * (inverse - a[:, None] * c - b[:, None] * s) ** 2
    return np.asarray(np.sqrt(error.sum(axis=1) / there.sum(axis=1)))
