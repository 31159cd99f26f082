"""Wheels, gyro and scans all tell how far a machine turned: of three, two that agree outvote one.

They are compared over stretches of `SPAN`. What differs by no more than clocks that are `LATE`, a
wheel base that is a quarter wrong or a gyro's steady bias agrees. Stretches in which nothing turns
say nothing of wheels that stand or a gyro that is turned round: what was outvoted before and after
is left out there, too. Which of two is wrong cannot be told.

>>> ends = np.arange(60.0)
>>> stands = 0.4 * np.minimum(ends, 30.0)                         # from 30 s on
>>> outvoted(ends, np.column_stack([0.4 * ends, 0.4 * ends, stands]))
[(2, 26.0, 59.0)]
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evertwin.types import Float64, Vector

SPAN = 4.0
"""Time over which turns are compared [s]."""
LATE = 0.5
"""How far clocks may differ [s]."""
APART, PART = 0.1, 0.25
"""How far turns may differ [rad], and as a share of the larger one."""
TELLS = 0.3
"""Turn of a stretch that confirms who tells it [rad]."""
CLOSE = 0.5
"""So much of that is near enough to confirm."""
FEW = 3
"""Stretches, a second apart, that are no outvoting."""
BIASED = 0.05
"""Largest bias of a gyro that is none of its faults [rad/s]."""
LAGS = np.linspace(-LATE, LATE, 11)


def steady(ends: Vector, angle: Vector, *others: Vector) -> Vector:
    """A gyro's angle without the bias that it mostly has where the others hardly turn."""
    turn = turned(ends, angle)
    rest = np.all([np.abs(turned(ends, other)) < APART for other in others], axis=0)
    off = np.sort(turn[rest & np.isfinite(turn)])
    half = len(off) // 2
    if len(off) < FEW:
        return angle
    least = int(np.argmin(off[half:] - off[: len(off) - half]))  # the shortest half: a mode
    bias = float(np.median(off[least : least + half + 1])) / SPAN
    return np.asarray(angle - bias * ends) if abs(bias) < BIASED else angle


def apart(ends: Vector, one: Vector, other: Vector) -> Vector:
    """How far two turn apart in each stretch, over how far they may; NaN where one is not known."""
    turn, at = turned(ends, one), turned(ends, other)
    late = np.array([turned(ends, other, lag) for lag in LAGS])
    late = np.where(np.isfinite(late), late, at)
    low, high = late.min(axis=0), late.max(axis=0)
    slack = APART + PART * np.maximum(np.abs(turn), np.maximum(np.abs(low), np.abs(high)))
    return np.asarray(np.maximum(np.maximum(low - turn, turn - high), 0.0) / slack)


def turned(ends: Vector, angle: Vector, lag: float = 0.0) -> Vector:
    """By how much an angle grows in the `SPAN` from each of ``ends`` on; NaN where not known."""
    there = [np.interp(at, ends, angle) for at in (ends + lag, ends + lag + SPAN)]
    outside = (ends + lag < ends[0]) | (ends + lag + SPAN > ends[-1])
    n = round(SPAN / max(ends[1] - ends[0], 1e-9))
    gaps = np.concatenate([[0], np.cumsum(~np.isfinite(angle))])
    last = np.minimum(np.arange(len(ends)) + n + 1, len(ends))
    outside |= gaps[last] > gaps[np.arange(len(ends))]
    return np.where(outside, np.nan, there[1] - there[0])


def outvoted(ends: Vector, angles: Float64[np.ndarray, "n 3"]) -> list[tuple[int, float, float]]:
    """Who turned otherwise than the two others, from when to when.

    Args:
        ends: times, evenly apart [s].
        angles: of three witnesses, not wrapped [rad]; NaN where one is not known.
    """
    found = []
    for k in range(3):
        i, j = (other for other in range(3) if other != k)
        between, mine = apart(ends, angles[:, i], angles[:, j]), [
            apart(ends, angles[:, k], angles[:, other]) for other in (i, j)
        ]  # fmt: skip
        odd = (between < 1) & (np.min(mine, axis=0) > 1)
        confirmed = (np.fmin(*mine) < CLOSE) & (np.abs(turned(ends, angles[:, k])) > TELLS)
        spans: list[tuple[float, float]] = []
        for start, end in _spans(ends, odd, confirmed):
            if spans and start <= spans[-1][1]:
                start, end = spans.pop()[0], end
            spans.append((start, end))
        found += [(k, *span) for span in spans]
    return found


def _spans(ends: Vector, odd: np.ndarray, confirmed: np.ndarray) -> Iterator[tuple[float, float]]:
    """From the last stretch that confirms to the next one, around those that are odd."""
    sure, wrong = np.flatnonzero(confirmed & ~odd), np.flatnonzero(odd)
    for group in np.split(wrong, np.flatnonzero(np.diff(ends[wrong]) > 2 * SPAN) + 1):
        if len(group) < FEW:
            continue
        before, after = sure[sure < group[0]], sure[sure > group[-1]]
        start = ends[before[-1]] if len(before) else ends[0]
        end = ends[after[0]] + PART * SPAN if len(after) else ends[-1]
        yield float(start), float(max(end, ends[group[-1]]))
