"""A scan onto a map of surface points: point to line, by Gauss-Newton.

Each point of the scan, placed at the pose, asks the map for the line beside it: the mean of the
map's points within `REACH` that face the same way, and of their normals, the near ones counting
most. What it is off across this line is its residual. Along the line it says nothing; a corridor
therefore leaves one direction to the prior, and the information matrix says so.

    e = m · (R(θ) p + t − q)        de/d(x, y, θ) = (m_x, m_y, m · R'(θ) p)

Points that are far off weigh little (Cauchy), at a scale that follows the residuals themselves.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit

REACH = 0.3
"""How far beside a point the map is asked [m]; side of a bin."""
WIDE, NARROW = 0.3, 0.1
"""How far off its line a point may be, at first and in the end [m]."""
FACING = 0.8
"""Cosine between normals from which on two points are of one wall."""
SPOT = 3.0
"""Scale of a spot's residual (a leg, a post) in that of a wall's; it is looked for twice as far."""
SCATTER = 0.003
"""Square of the error of a normal [rad²]: so much of a wall points along it, to no avail."""
NOISE, STRAY, UNSEEN = 0.04, 0.05, 0.3
"""Error of a point across its wall [m]; how likely any other is, and one where no map is."""
ROUNDS = 25
BUCKETS = 8192
"""Of the table of bins: a power of two."""


@njit(cache=True)
def bucket(ix: int, iy: int) -> int:
    """Where the bin (ix, iy) is kept; others may share it."""
    return ((ix * 73856093) ^ (iy * 19349663)) & (BUCKETS - 1)


@njit(cache=True)
def binned(points: Any, n: int, heads: Any, order: Any) -> None:
    """Sorts the points by bins of `REACH`: those of bucket b are order[heads[b] : heads[b + 1]].

    Args:
        points: (m, 4), the first ``n`` of which count.
        heads: (BUCKETS + 1,) int64, to be filled.
        order: (m,) int64, to be filled.
    """
    heads[:] = 0
    for i in range(n):
        b = bucket(math.floor(points[i, 0] / REACH), math.floor(points[i, 1] / REACH))
        heads[b + 1] += 1
    for b in range(BUCKETS):
        heads[b + 1] += heads[b]
    for i in range(n - 1, -1, -1):
        b = bucket(math.floor(points[i, 0] / REACH), math.floor(points[i, 1] / REACH))
        heads[b + 1] -= 1
        order[heads[b + 1]] = i
    for b in range(BUCKETS):
        heads[b] = heads[b + 1]
    heads[BUCKETS] = n


@njit(cache=True)
def beside(points: Any, heads: Any, order: Any, at: Any, width: float) -> Any:
    """The map's line beside a placed point ``at`` (x, y, nx, ny): its weight, residual, normal."""
    x, y, nx, ny = at
    cx, cy = math.floor(x / REACH), math.floor(y / REACH)
    weight, e, mx, my = 0.0, 0.0, 0.0, 0.0
    for ix in range(cx - 1, cx + 2):
        for iy in range(cy - 1, cy + 2):
            b = bucket(ix, iy)
            for k in range(heads[b], heads[b + 1]):
                i = order[k]
                facing = nx * points[i, 2] + ny * points[i, 3]
                if facing < FACING:
                    continue
                dx, dy = x - points[i, 0], y - points[i, 1]
                if math.floor(points[i, 0] / REACH) != ix or math.floor(points[i, 1] / REACH) != iy:
                    continue
                off = dx * points[i, 2] + dy * points[i, 3]
                near = 1 - (dx * dx + dy * dy) / (REACH * REACH)
                if near <= 0 or abs(off) > width:
                    continue
                w = near * near
                weight += w
                e += w * off
                mx, my = mx + w * points[i, 2], my + w * points[i, 3]
    if weight <= 0:
        return 0.0, 0.0, 0.0, 0.0
    length = math.sqrt(mx * mx + my * my)
    return weight, e / weight, mx / length, my / length


@njit(cache=True)
def spot(points: Any, heads: Any, order: Any, x: float, y: float, width: float) -> Any:
    """The mean of the map's points without a wall beside (x, y): weight, and how far off."""
    cx, cy = math.floor(x / REACH), math.floor(y / REACH)
    weight, ex, ey = 0.0, 0.0, 0.0
    for ix in range(cx - 1, cx + 2):
        for iy in range(cy - 1, cy + 2):
            b = bucket(ix, iy)
            for k in range(heads[b], heads[b + 1]):
                i = order[k]
                if points[i, 2] != 0 or points[i, 3] != 0:
                    continue
                dx, dy = x - points[i, 0], y - points[i, 1]
                near = 1 - (dx * dx + dy * dy) / (width * width)
                if near <= 0:
                    continue
                if math.floor(points[i, 0] / REACH) != ix or math.floor(points[i, 1] / REACH) != iy:
                    continue
                w = near * near
                weight, ex, ey = weight + w, ex + w * dx, ey + w * dy
    if weight <= 0:
        return 0.0, 0.0, 0.0
    return weight, ex / weight, ey / weight


@njit(cache=True)
def solved(h: Any, g: Any, step: Any) -> bool:
    """step = -h⁻¹ g for a positive definite 3 × 3 matrix, by Cholesky; False where it is none."""
    a = h[0, 0]
    if not a > 0:
        return False
    l00 = math.sqrt(a)
    l10, l20 = h[1, 0] / l00, h[2, 0] / l00
    b = h[1, 1] - l10 * l10
    if not b > 0:
        return False
    l11 = math.sqrt(b)
    l21 = (h[2, 1] - l20 * l10) / l11
    c = h[2, 2] - l20 * l20 - l21 * l21
    if not c > 0:
        return False
    l22 = math.sqrt(c)
    y0 = -g[0] / l00
    y1 = (-g[1] - l10 * y0) / l11
    y2 = (-g[2] - l20 * y0 - l21 * y1) / l22
    step[2] = y2 / l22
    step[1] = (y1 - l21 * step[2]) / l11
    step[0] = (y0 - l10 * step[1] - l20 * step[2]) / l00
    return True


@njit(cache=True)
def freed(h: Any, g: Any, least: float) -> None:
    """Takes out of ``h`` and ``g`` the direction that walls leave open, as those of a corridor do.

    What is less than ``least`` along it is not told by walls: it is the scatter of their normals.
    """
    half = 0.5 * (h[0, 0] + h[1, 1])
    spread = math.sqrt(0.25 * (h[0, 0] - h[1, 1]) * (h[0, 0] - h[1, 1]) + h[1, 0] * h[1, 0])
    if half - spread >= least:
        return
    along = 0.5 * math.atan2(2 * h[1, 0], h[0, 0] - h[1, 1])  # of the larger eigenvalue
    c, s = math.cos(along), math.sin(along)
    big, turn, pull = half + spread, c * h[2, 0] + s * h[2, 1], c * g[0] + s * g[1]
    h[0, 0], h[1, 0], h[1, 1] = big * c * c, big * c * s, big * s * s
    h[2, 0], h[2, 1] = turn * c, turn * s
    g[0], g[1] = pull * c, pull * s


@njit(cache=True)
def explained(scan: Any, n: int, points: Any, heads: Any, order: Any, pose: Any) -> float:
    """Share of a scan's points, placed at ``pose``, that lie beside a wall or a spot of the map."""
    c, s, found = math.cos(pose[2]), math.sin(pose[2]), 0
    for i in range(n):
        x = c * scan[i, 0] - s * scan[i, 1] + pose[0]
        y = s * scan[i, 0] + c * scan[i, 1] + pose[1]
        nx, ny = c * scan[i, 2] - s * scan[i, 3], s * scan[i, 2] + c * scan[i, 3]
        if nx == 0 and ny == 0:
            found += spot(points, heads, order, x, y, 2 * NARROW)[0] > 0
        else:
            found += beside(points, heads, order, (x, y, nx, ny), NARROW)[0] > 0
    return found / n if n else 0.0


@njit(cache=True)
def seldom(points: Any, heads: Any, order: Any, x: float, y: float) -> bool:
    """Has the map no point at all around (x, y)?"""
    cx, cy = math.floor(x / REACH), math.floor(y / REACH)
    for ix in range(cx - 1, cx + 2):
        for iy in range(cy - 1, cy + 2):
            b = bucket(ix, iy)
            for k in range(heads[b], heads[b + 1]):
                px, py = points[order[k], 0], points[order[k], 1]
                if math.floor(px / REACH) == ix and math.floor(py / REACH) == iy:
                    return False
    return True


@njit(cache=True)
def likelihood(scan: Any, n: int, points: Any, heads: Any, order: Any, pose: Any) -> Any:
    """Mean over a scan's points, placed at ``pose``, of the logarithm of how likely each is.

    A point beside a wall of the map errs by `NOISE`, any other is `STRAY`; where the map has no
    point at all, it says less against the pose (`UNSEEN`).

    Returns:
        the mean, and the share of the points that lie where the map has none.
    """
    c, s, total, unseen = math.cos(pose[2]), math.sin(pose[2]), 0.0, 0
    for i in range(n):
        x = c * scan[i, 0] - s * scan[i, 1] + pose[0]
        y = s * scan[i, 0] + c * scan[i, 1] + pose[1]
        nx, ny = c * scan[i, 2] - s * scan[i, 3], s * scan[i, 2] + c * scan[i, 3]
        if nx == 0 and ny == 0:
            known, ex, ey = spot(points, heads, order, x, y, REACH)
            square = (ex * ex + ey * ey) / (SPOT * SPOT)
        else:
            known, e, _, _ = beside(points, heads, order, (x, y, nx, ny), REACH)
            square = e * e
        near = math.exp(-0.5 * square / (NOISE * NOISE)) if known > 0 else 0.0
        if near == 0 and seldom(points, heads, order, x, y):
            total, unseen = total + math.log(UNSEEN), unseen + 1
        else:
            total += math.log(STRAY + (1 - STRAY) * near)
    return (total / n, unseen / n) if n else (0.0, 1.0)


@njit(cache=True)
def added(h: Any, w: float, x: float, y: float, turn: float) -> None:
    """Adds what one residual tells: ``w`` times its gradient's square, in the lower triangle."""
    h[0, 0] += w * x * x
    h[1, 0] += w * x * y
    h[1, 1] += w * y * y
    h[2, 0] += w * x * turn
    h[2, 1] += w * y * turn
    h[2, 2] += w * turn * turn


@njit(cache=True)
def register(
    scan: Any, n: int, points: Any, heads: Any, order: Any, prior: Any, weight: Any, pose: Any,
    information: Any,
) -> Any:  # fmt: skip
    """Moves ``pose`` (3,) to where the scan fits the map best.

    Args:
        scan: (beams, 4), the first ``n`` rows of which are surface points.
        points: of the map, (m, 4), with its bins ``heads`` and ``order``.
        prior: pose that is expected, (3,).
        weight: information about it, (3, 3).
        pose: start of the search; where it ends, to be filled.
        information: about the pose by the scan alone, (3, 3), to be filled.

    Returns:
        the share of the points that have a line beside them, the scale of their residuals [m], and
        the correlation of those of neighbours.
    """
    # longer than the budget: one sum over the points, written once
    h, g, step = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    width, scale, share, alike, squares = WIDE, 0.1, 0.0, 0.0, 0.0
    for _ in range(ROUNDS):
        c, s = math.cos(pose[2]), math.sin(pose[2])
        h[:], g[:] = 0.0, 0.0
        found, total, off, lines = 0, 0.0, 0.0, 0
        before, alike, squares = 0.0, 0.0, 0.0
        for i in range(n):
            px, py = c * scan[i, 0] - s * scan[i, 1], s * scan[i, 0] + c * scan[i, 1]
            nx, ny = c * scan[i, 2] - s * scan[i, 3], s * scan[i, 2] + c * scan[i, 3]
            if nx == 0 and ny == 0:
                known, ex, ey = spot(points, heads, order, px + pose[0], py + pose[1], 2 * width)
                if known > 0:
                    sq = (ex * ex + ey * ey) / (SPOT * SPOT * scale * scale)
                    w = 1 / (1 + sq) / (SPOT * SPOT)
                    g[0], g[1], g[2] = g[0] + w * ex, g[1] + w * ey, g[2] + w * (px * ey - py * ex)
                    h[0, 0] += w
                    h[1, 1] += w
                    h[2, 0] -= w * py
                    h[2, 1] += w * px
                    h[2, 2] += w * (px * px + py * py)
                continue
            lines += 1
            at = (px + pose[0], py + pose[1], nx, ny)
            known, e, mx, my = beside(points, heads, order, at, width)
            if known <= 0:
                continue
            found += 1
            w = 1 / (1 + (e / scale) * (e / scale))
            total, off = total + w, off + w * e * e
            alike, squares = alike + w * e * before, squares + w * e * w * e
            before = w * e
            turn = my * px - mx * py
            g[0], g[1], g[2] = g[0] + w * mx * e, g[1] + w * my * e, g[2] + w * turn * e
            added(h, w, mx, my, turn)
        share = found / lines if lines else 0.0
        if found < 3:
            return 0.0, scale, 1.0
        freed(h, g, SCATTER * found)
        scale = max(1.5 * math.sqrt(off / total), 0.01)
        narrow = min(max(NARROW, 4 * scale), WIDE)
        precision = 1 / (scale * scale)
        for i in range(3):
            for j in range(i + 1):
                information[i, j] = information[j, i] = h[i, j] * precision
        dx, dy, da = pose[0] - prior[0], pose[1] - prior[1], pose[2] - prior[2]
        for i in range(3):
            g[i] = g[i] * precision + weight[i, 0] * dx + weight[i, 1] * dy + weight[i, 2] * da
            for j in range(i + 1):
                h[i, j] = h[i, j] * precision + weight[i, j]
        if not solved(h, g, step):
            return 0.0, scale, 1.0
        pose[0], pose[1], pose[2] = pose[0] + step[0], pose[1] + step[1], pose[2] + step[2]
        small = abs(step[0]) + abs(step[1]) + abs(step[2])
        if small < 2e-4 and width <= narrow:
            break
        if small < 0.02:
            width = max(0.6 * width, narrow)
    return share, scale, alike / squares if squares > 0 else 0.0


@njit(cache=True)
def firmness(
    scan: Any, n: int, points: Any, heads: Any, order: Any, pose: Any, scale: float, shared: float
) -> Any:
    """Information about ``pose`` (3, 3) that a scan tells beside lines which err themselves.

    A line of m points has 1/m of a point's variance, the same for the ``shared`` scans in a row
    that meet it: what few points tell is told once, not by each scan anew. So they are worth
    m / (m + shared) of what they would be, were the map without error.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    h, g, found = np.zeros((3, 3)), np.zeros(3), 0.0
    for i in range(n):
        px, py = c * scan[i, 0] - s * scan[i, 1], s * scan[i, 0] + c * scan[i, 1]
        x, y = px + pose[0], py + pose[1]
        nx, ny = c * scan[i, 2] - s * scan[i, 3], s * scan[i, 2] + c * scan[i, 3]
        if nx == 0 and ny == 0:
            known, ex, ey = spot(points, heads, order, x, y, 2 * NARROW)
            if known > 0:
                square = (ex * ex + ey * ey) / (SPOT * SPOT * scale * scale)
                w = known / (known + shared) / (1 + square) / (SPOT * SPOT)
                added(h, w, 1.0, 0.0, -py)
                added(h, w, 0.0, 1.0, px)
            continue
        known, e, mx, my = beside(points, heads, order, (x, y, nx, ny), NARROW)
        if known > 0:
            w = known / (known + shared) / (1 + (e / scale) * (e / scale))
            added(h, w, mx, my, my * px - mx * py)
            found += known / (known + shared)
    freed(h, g, SCATTER * found)
    for i in range(3):
        for j in range(i + 1):
            h[i, j] = h[j, i] = h[i, j] / (scale * scale)
    return h
