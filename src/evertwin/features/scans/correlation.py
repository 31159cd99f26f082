"""Where a scan fits a map best, anywhere in a window: every pose is tried, by branch and bound.

The map is drawn into a grid whose cells say how near a wall is. A pose is as good as the mean of
the cells that the scan's points fall into. A second grid holds, for each cell, the best of the
`BLOCK` × `BLOCK` cells from there on: with it, one sum bounds all shifts within a block from above,
and only blocks that can still win are opened (Olson, ICRA 2009; Hess et al., ICRA 2016).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.types import Float64, Int32, Int64, UInt8

CELL = 0.1
"""Side of a cell [m]."""
BLOCK = 4
"""Shifts that are bounded together, along each axis."""
BLUR = 2
"""Cells around a point that are near it."""
FULL = 250
"""Value of a cell with a point in its middle."""


@njit(cache=True)
def drawn(points: Any, n: int, corner: Any, grid: Any, best: Any) -> None:
    """Fills ``grid`` and ``best`` (rows: x, columns: y; uint8), whose corner is at ``corner``."""
    size = grid.shape[0]
    grid[:], best[:] = 0, 0
    for k in range(n):
        fx, fy = (points[k, 0] - corner[0]) / CELL, (points[k, 1] - corner[1]) / CELL
        cx, cy = math.floor(fx), math.floor(fy)
        for ix in range(max(cx - BLUR, 0), min(cx + BLUR + 1, size)):
            for iy in range(max(cy - BLUR, 0), min(cy + BLUR + 1, grid.shape[1])):
                dx, dy = ix + 0.5 - fx, iy + 0.5 - fy
                value = int(FULL * math.exp(-0.5 * (dx * dx + dy * dy)))
                if value > grid[ix, iy]:
                    grid[ix, iy] = value
    for ix in range(size):
        for iy in range(grid.shape[1]):
            if grid[ix, iy]:
                for jx in range(max(ix - BLOCK + 1, 0), ix + 1):
                    for jy in range(max(iy - BLOCK + 1, 0), iy + 1):
                        if grid[ix, iy] > best[jx, jy]:
                            best[jx, jy] = grid[ix, iy]


def blocks(half_width: float) -> int:
    """Blocks of shifts along each side of a window: one in the middle, and so many to each side."""
    return 2 * math.ceil(half_width / (CELL * BLOCK)) + 1


@njit(cache=True)
def total(grid: Any, cells: Any, n: int, sx: int, sy: int) -> int:
    """Sum of the cells under a scan that is shifted by (sx, sy) cells."""
    found = 0
    for k in range(n):
        ix, iy = cells[k, 0] + sx, cells[k, 1] + sy
        if 0 <= ix < grid.shape[0] and 0 <= iy < grid.shape[1]:
            found += int(grid[ix, iy])
    return found


@njit(cache=True)
def bounded(
    scan: Any, n: int, best: Any, corner: Any, window: Any, pose: Any, cells: Any, bounds: Any
) -> None:  # fmt: skip
    """Fills ``cells`` (turns, n, 2), where points fall, and ``bounds`` (turns, blocks, blocks)."""
    turns, side, half = cells.shape[0] // 2, bounds.shape[1], bounds.shape[1] // 2
    for a in range(cells.shape[0]):
        angle = pose[2] + (a - turns) * window[1] / turns
        c, s = math.cos(angle), math.sin(angle)
        for k in range(n):
            x = c * scan[k, 0] - s * scan[k, 1] + pose[0] - corner[0]
            y = s * scan[k, 0] + c * scan[k, 1] + pose[1] - corner[1]
            cells[a, k, 0], cells[a, k, 1] = math.floor(x / CELL), math.floor(y / CELL)
            # point by point: the cells of one lie side by side, and in the cache
            low = max(half - cells[a, k, 1] // BLOCK, 0)
            high = min(half + (best.shape[1] - 1 - cells[a, k, 1]) // BLOCK, side - 1)
            for bx in range(side):
                row, first = cells[a, k, 0] + (bx - half) * BLOCK, cells[a, k, 1] - half * BLOCK
                if 0 <= row < best.shape[0]:
                    for by in range(low, high + 1):
                        bounds[a, bx, by] += best[row, first + by * BLOCK]


@njit(cache=True)
def opened(grid: Any, cells: Any, bounds: Any, order: Any, found: Any) -> int:
    """Looks into blocks, the most promising first; ``found``: turn and shifts of the best pose.

    Args:
        grid: of the map, see `drawn`.
        cells: see `bounded`, with ``bounds`` in one row each.
        order: of the blocks.
        found: (3,) int64, to be filled.

    Returns:
        the sum of the cells under the scan there.
    """
    top, n = 0, cells.shape[1]
    side = int(math.sqrt(bounds.shape[0] // cells.shape[0]) + 0.5)
    for at in order:
        if bounds[at] <= top:
            break
        a, rest = at // (side * side), at % (side * side)
        left, low = (rest // side - side // 2) * BLOCK, (rest % side - side // 2) * BLOCK
        for sx in range(left, left + BLOCK):
            for sy in range(low, low + BLOCK):
                value = total(grid, cells[a], n, sx, sy)
                if value > top:
                    top = value
                    found[0], found[1], found[2] = a, sx, sy
    return top


class Drawing(NamedTuple):
    """A map as grids.

    >>> Drawing.of(np.array([[0.0, 0.0]]), np.zeros(2), 8).grid.max()
    np.uint8(194)
    """

    grid: UInt8[np.ndarray, "side side"]
    best: UInt8[np.ndarray, "side side"]
    corner: Float64[np.ndarray, " 2"]
    """Of the grid [m]."""

    @classmethod
    def of(cls, points: np.ndarray, middle: np.ndarray, side: int) -> Drawing:
        """Points (k, ≥ 2) in a square of ``side`` cells around ``middle``."""
        grid = np.zeros((side, side), np.uint8)
        best, corner = grid.copy(), np.asarray(middle - 0.5 * side * CELL)
        drawn(points, len(points), corner, grid, best)
        return cls(grid, best, corner)


class Bounds(NamedTuple):
    """What a scan is worth at most, by block of poses; for several searches of one window.

    >>> Bounds._fields
    ('drawing', 'cells', 'bounds', 'pose', 'window')
    """

    drawing: Drawing
    cells: Int64[np.ndarray, "turns n 2"]
    bounds: Int32[np.ndarray, "turns side side"]
    pose: Float64[np.ndarray, " 3"]
    window: Float64[np.ndarray, " 3"]

    @classmethod
    def of(
        cls,
        scan: np.ndarray,
        drawing: Drawing,
        window: np.ndarray,
        side: int,
        pose: np.ndarray,
    ) -> Bounds:
        """Of the poses in a window.

        Args:
            scan: points (k, ≥ 2).
            drawing: the map.
            window: half its width [m], half its turn and the step of the turn [rad].
            side: blocks of shifts along each side of the window; see `blocks`.
            pose: middle of the window (3,).
        """
        turns, n = max(math.ceil(window[1] / window[2]), 1), len(scan)
        cells = np.zeros((2 * turns + 1, n, 2), np.int64)
        bounds = np.zeros((2 * turns + 1, side, side), np.int32)
        bounded(scan, n, drawing.best, drawing.corner, window, pose, cells, bounds)
        return cls(drawing, cells, bounds, pose, window)

    def search(self, allowed: np.ndarray) -> tuple[np.ndarray, float]:
        """The best pose, and the mean of the cells under the scan there, 0 to 1.

        Args:
            allowed: 0 where no pose is wanted, by block of shifts (side, side).
        """
        turns, flat = len(self.cells) // 2, (self.bounds * allowed).ravel()
        found = np.array([turns, 0, 0], np.int64)
        grid, cells = self.drawing.grid, self.cells
        floor = opened(grid, cells, flat, np.array([flat.argmax()]), found)
        worth = np.flatnonzero(flat > floor)
        order = worth[np.argsort(-flat[worth], kind="stable")]
        top = max(opened(grid, cells, flat, order, found), floor)
        turn = (found[0] - turns) * self.window[1] / turns
        pose = self.pose + np.array([found[1] * CELL, found[2] * CELL, turn])
        return pose, top / (FULL * max(cells.shape[1], 1))
