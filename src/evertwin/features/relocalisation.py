"""Where is this scan? In a map alone, without a pose to start from.

The map's walls become surface points, every pose is looked at by branch and bound, the best is
matched point to line. It is believed where it explains most of the scan, where the scan leaves no
direction open, and where no other place explains nearly as much: then the answer is that it cannot
be told.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from evertwin.features.correlation import BLOCK, BLUR, CELL, Drawing, blocks, search
from evertwin.features.local_map import Known, Surface, placed
from evertwin.features.occupancy import FREE, Occupancy
from evertwin.features.scan_fit import Expected, balanced, fitted
from evertwin.features.scan_matcher import FEW
from evertwin.types import Float64, UInt8

NEAR = 0.25
"""Walls within this share a direction [m]."""
CLOSE = 0.15
"""A point this near to a wall is explained by it [m]."""
ALIKE = 0.75
"""Share of the scan that must be explained."""
OTHER = 1.0
"""Way from a place to another one [m]."""
CLEARLY = 0.1
"""By how much more it must explain than any other place."""
TOLD = 0.1
"""Largest standard deviation of a place that is told [m]."""
TURN = 0.06
"""Step between the headings that are tried [rad]."""
VAGUE = np.diag([0.3, 0.3, 0.1]) ** 2
"""Error of what is found before it is matched (m², m², rad²)."""


class Located(NamedTuple):
    """A place in a map, or why none can be told.

    >>> Located(None, None, 0.4, "only 40 % of the scan fits").pose is None
    True
    """

    pose: Float64[np.ndarray, " 3"] | None
    covariance: Float64[np.ndarray, "3 3"] | None
    share: float
    """Of the scan that is explained."""
    reason: str = ""


def map_surface(chart: Occupancy) -> Surface:
    """The walls of a map as surface points (k, 4), their normals towards where it is free."""
    walls = chart.walls()
    if not len(walls):
        return np.zeros((0, 4))
    tree = cKDTree(walls)
    out = np.zeros((len(walls), 4))
    out[:, :2] = walls
    for k, near in enumerate(tree.query_ball_point(walls, NEAR)):
        off = walls[near] - walls[near].mean(axis=0)
        values, vectors = np.linalg.eigh(off.T @ off)
        if len(near) >= 4 and values[0] < 0.1 * values[1]:
            out[k, 2:] = vectors[:, 0] * _free_side(chart, walls[k], vectors[:, 0])
    return out


def _free_side(chart: Occupancy, at: np.ndarray, normal: np.ndarray) -> float:
    def free(point: np.ndarray) -> int:
        column, row = ((point - chart.origin) // chart.resolution).astype(np.int64)
        inside = 0 <= row < chart.cells.shape[0] and 0 <= column < chart.cells.shape[1]
        return int(inside and chart.cells[row, column] == FREE)

    ahead = sum(free(at + k * chart.resolution * normal) for k in (2, 3, 4))
    behind = sum(free(at - k * chart.resolution * normal) for k in (2, 3, 4))
    return 1.0 if ahead >= behind else -1.0


def located(scan: Surface, chart: Occupancy) -> Located:
    """The pose of a scan in a map.

    Args:
        scan: surface points, in the lidar's frame.
        chart: the map; a robot stands where it is free.
    """
    walls = map_surface(chart)
    if len(scan) < FEW or not len(walls):
        return Located(None, None, 0.0, f"{len(scan)} points and {len(walls)} walls are too few")
    window = _Window.around(chart)
    size = math.ceil(2 * window.half / CELL) + 2 * BLUR + 2
    drawing = Drawing.of(walls, window.middle, size)
    view, some, tree = Known.of(walls), balanced(scan), cKDTree(walls[:, :2])

    def found(allowed: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        turns = np.array([window.half, math.pi, TURN])
        start, _ = search(some, drawing, turns, allowed, np.array([*window.middle, 0.0]))
        fit = fitted(scan, view, Expected(start, VAGUE), start)
        off, _ = tree.query(placed(scan, fit.pose)[:, :2])
        return fit.pose, fit.covariance, float(np.mean(off < CLOSE))

    pose, covariance, share = found(window.free)
    if share < ALIKE:
        return Located(None, None, share, f"only {100 * share:.0f} % of the scan fits anywhere")
    if math.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]) > TOLD:
        return Located(None, None, share, "the scan leaves a direction open, as in a corridor")
    other, _, second = found(window.free * window.beyond(pose[:2]))
    if second > share - CLEARLY:
        return Located(
            None, None, share, f"two places fit alike: {100 * share:.0f} % at ({pose[0]:.1f}, "
            f"{pose[1]:.1f}) m, {100 * second:.0f} % at ({other[0]:.1f}, {other[1]:.1f}) m",
        )  # fmt: skip
    return Located(pose, covariance, share)


class _Window(NamedTuple):
    """The free part of a map, by blocks of shifts from its middle."""

    middle: Float64[np.ndarray, " 2"]
    half: float
    places: Float64[np.ndarray, "side side 2"]
    """Middles of the blocks [m]."""
    free: UInt8[np.ndarray, "side side"]

    @classmethod
    def around(cls, chart: Occupancy) -> _Window:
        row, column = np.nonzero(chart.cells == FREE)
        at = (np.column_stack([column, row]) + 0.5) * chart.resolution + np.array(chart.origin)
        low, high = at.min(axis=0), at.max(axis=0)
        middle, half = 0.5 * (low + high), 0.5 * float((high - low).max())
        side = blocks(half)
        steps = (np.arange(side) - side // 2) * BLOCK * CELL
        corners = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1) + middle
        inside = np.floor((at - corners[0, 0]) / (BLOCK * CELL)).astype(np.int64)
        inside = inside[(inside < side).all(axis=1)]
        free = np.zeros((side, side), np.uint8)
        free[inside[:, 0], inside[:, 1]] = 1
        return cls(middle, half, corners + 0.5 * BLOCK * CELL, free)

    def beyond(self, place: np.ndarray) -> np.ndarray:
        """1 for the blocks of other places than this."""
        off = self.places - place
        return np.asarray(np.hypot(off[..., 0], off[..., 1]) > OTHER, dtype=np.uint8)
