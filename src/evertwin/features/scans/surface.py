"""A scan as pieces of surface: where each beam ended, and which way the wall faces there.

The normal of a point is that of the line through its neighbours in the order of the beams, as far
as these lie on one piece of wall. A point without such neighbours (a leg of a chair, a beam that
met two walls) says nothing about a line and is left out.

>>> ranges = 2 / np.cos(np.linspace(-0.4, 0.4, 41))      # a wall 2 m ahead
>>> found = np.zeros((41, 4))
>>> count = surface(ranges, np.linspace(-0.4, 0.4, 41), found)
>>> count, found[20].round(6).tolist()
(41, [2.0, 0.0, -1.0, 0.0])
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import ordered

SPAN = 0.15
"""Half the length of wall that a normal is told from, at least [m]."""
SIGMAS = 12.0
"""The same in standard deviations of a range: less would be as round as long."""
BEAMS = 3.0
"""The same in steps from beam to beam, where these are far apart."""
QUARTILE = 1 / (0.3186 * math.sqrt(1.5))
"""Standard deviation over the lower quartile of |a − (b + c)/2|, for normal noise."""
EQUAL = 1e-9
"""Lengths that differ by less are equal [m]."""
WIDEST = 0.5
"""Largest half length of wall [m]."""
FLAT = 4.0
"""How many times as far apart points may be on a wall that is met at a flat angle."""
LEAST = 3
"""Points that make a line."""
ROUND = 0.15
"""Largest width of a piece of wall, as a share of its length."""
STEADY = 0.3
"""Largest standard deviation of a wall's direction [rad]."""


@njit(cache=True)
def noise(ranges: Any) -> float:
    """Standard deviation of the ranges [m], from how far each is off its two neighbours' middle.

    By its lower quartile: what is not flat is off by more. Ranges come in steps, of a centimetre
    say: among equal ones it lies as far into the step as many of them lie before it.
    """
    off = np.zeros(len(ranges))
    n = 0
    for i in range(1, len(ranges) - 1):
        bend = abs(ranges[i] - 0.5 * (ranges[i - 1] + ranges[i + 1]))
        if bend >= 0:  # all three came back
            off[n] = bend
            n += 1
    if not n:
        return 0.0
    sizes = ordered(off[:n])
    quarter, low, high = sizes[n // 4], n // 4, n // 4
    while low > 0 and quarter - sizes[low - 1] < EQUAL:
        low -= 1
    while high < n and sizes[high] - quarter < EQUAL:
        high += 1
    half = 0.5 * (sizes[high] - quarter) if high < n else 0.0
    begin, share = max(quarter - half, 0.0), (0.25 * n - low) / (high - low)
    return float(QUARTILE * (begin + (quarter + half - begin) * share))


@njit(cache=True)
def gathered(ranges: Any, angles: Any, i: int, way: int, reach: float, sums: Any) -> bool:
    """Fills ``sums``: points on one side of beam ``i`` that lie near it, and their moments.

    True where what comes behind them is farther away by a quarter of ``reach``: the beam met the
    edge of something. A wall that is met straight on goes back too, but less.
    """
    r = ranges[i]
    x, y = r * math.cos(angles[i]), r * math.sin(angles[i])
    sums[:] = 0.0
    j = i + way
    while 0 <= j < len(ranges) and ranges[j] > 0:
        dx = ranges[j] * math.cos(angles[j]) - x
        dy = ranges[j] * math.sin(angles[j]) - y
        if dx * dx + dy * dy > reach * reach:
            return bool(ranges[j] > r + 0.25 * reach)
        sums[0] += 1
        sums[1], sums[2] = sums[1] + dx, sums[2] + dy
        sums[3], sums[4], sums[5] = sums[3] + dx * dx, sums[4] + dx * dy, sums[5] + dy * dy
        j += way
    return False


@njit(cache=True)
def direction(sums: Any, sigma: float) -> Any:
    """Whether a beam and its neighbours are a line, and the line's direction [rad].

    Those of few points side by side, whose ranges err by ``sigma``, have any.
    """
    m = sums[0] + 1
    if m < LEAST:
        return False, 0.0
    sx, sy = sums[1] / m, sums[2] / m
    cxx, cxy, cyy = sums[3] / m - sx * sx, sums[4] / m - sx * sy, sums[5] / m - sy * sy
    spread = math.sqrt((cxx - cyy) * (cxx - cyy) + 4 * cxy * cxy)
    length = cxx + cyy + spread
    line = cxx + cyy - spread <= ROUND * ROUND * length
    line &= 0.5 * m * length * STEADY * STEADY >= sigma * sigma
    return line, 0.5 * math.atan2(2 * cxy, cxx - cyy)


@njit(cache=True)
def surface(ranges: Any, angles: Any, found: Any) -> int:
    """Fills ``found`` (beams, 4) with x, y, normal x, normal y [m] in the lidar's frame.

    Args:
        ranges: of each beam [m]; NaN where nothing came back.
        angles: of each beam [rad].
        found: to be filled.

    Returns:
        how many rows of it are filled.
    """
    count = 0
    left, right = np.zeros(6), np.zeros(6)
    sigma = min(noise(ranges), WIDEST / SIGMAS)
    span = min(max(SPAN, SIGMAS * sigma), WIDEST)
    for i in range(len(ranges)):
        if not ranges[i] > 0:
            continue
        reach = max(span, BEAMS * ranges[i] * abs(angles[1] - angles[0]))
        edges = gathered(ranges, angles, i, 1, reach, left)
        edges &= gathered(ranges, angles, i, -1, reach, right)
        line, along = direction(left + right, sigma)
        if not line:  # a corner: the wall on its longer side
            line, along = direction(left if left[0] > right[0] else right, sigma)
        if not line:
            line, along = direction(right if left[0] > right[0] else left, sigma)
        if not (line or edges):  # a wall that is met at a flat angle, its points far apart
            gathered(ranges, angles, i, 1, FLAT * reach, left)
            gathered(ranges, angles, i, -1, FLAT * reach, right)
            line, along = direction(left + right, sigma)
            if not line:
                continue
        x, y = ranges[i] * math.cos(angles[i]), ranges[i] * math.sin(angles[i])
        nx, ny = (-math.sin(along), math.cos(along)) if line else (0.0, 0.0)
        if nx * x + ny * y > 0:  # a wall is seen from its free side
            nx, ny = -nx, -ny
        found[count, 0], found[count, 1], found[count, 2], found[count, 3] = x, y, nx, ny
        count += 1
    return count
