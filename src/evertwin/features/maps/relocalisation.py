"""Where is this scan? In a map alone, without a pose to start from.

The map's walls become surface points, every pose is looked at by branch and bound, the best is
matched point to line. It is believed where it explains most of the scan, where the scan leaves no
direction open, and where no other place explains nearly as much: then the answer is that it cannot
be told.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.features.maps.occupancy import FREE, OCCUPIED, Occupancy
from evertwin.features.scans.correlation import BLOCK, BLUR, CELL, Bounds, Drawing, blocks
from evertwin.features.scans.local_map import Known, Surface, placed
from evertwin.features.scans.scan_fit import Expected, Fit, balanced, fitted
from evertwin.features.scans.scan_matcher import FEW
from evertwin.signals.planar import compose
from evertwin.types import Bool, Float64, Int64, UInt8

NEAR = 0.25
"""Walls within this share a direction [m]."""
CLOSE = 0.15
"""A point this near to a wall is explained by it [m]."""
ALIKE = 0.75
"""Share of the scan that must be explained."""
OTHER = 1.0
"""Way from a place to another one [m]."""
BEHIND = 0.12
"""A beam this far behind a wall passed through it [m]."""
PASSED = 0.04
"""Share of the beams that may pass through walls of the map: some of them moved."""
WALLS = 2.0
"""How much one that does so weighs against one that fits."""
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
    tree = scipy.spatial.cKDTree(walls)
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


class View(NamedTuple):
    """A scan, or one of several of which it is known how they lie to each other.

    >>> View(np.zeros((0, 4))).pose.tolist()
    [0.0, 0.0, 0.0]
    """

    surface: Surface
    """Its surface points, in its own frame."""
    pose: Float64[np.ndarray, " 3"] = np.zeros(3)
    """In the frame of the first view."""


class Barriers(NamedTuple):
    """Cells of a map by which a beam that passes through its walls is told.

    >>> Barriers._fields
    ('chart', 'middle', 'near')
    """

    chart: Occupancy
    middle: Bool[np.ndarray, "rows columns"]
    """In the middle of a wall: walls are drawn thicker than they are."""
    near: Bool[np.ndarray, "rows columns"]
    """Within `BEHIND`, or two cells, of one."""

    @classmethod
    def of(cls, chart: Occupancy) -> Barriers:
        """By the walls alone: of a large map they are few."""
        walls = chart.cells == OCCUPIED
        at = np.argwhere(walls)
        reach = max(BEHIND / chart.resolution, 2.0)
        near, deep = np.zeros_like(walls), np.zeros(walls.shape, np.float32)
        for off in _disc(reach):
            near[_inside(at + off, walls)] = True
        around = np.zeros_like(walls)
        for off in _disc(1.5):
            around[_inside(at + off, walls)] = True
        beside = np.argwhere(around & ~walls)
        if len(at) and len(beside):
            deep[tuple(at.T)] = scipy.spatial.cKDTree(beside).query(at)[0]
        most = np.max([deep[_inside(at + off, walls)] for off in _disc(1.5)], axis=0)
        middle = np.zeros_like(walls)
        middle[tuple(at[deep[tuple(at.T)] == most].T)] = True
        return cls(chart, middle, near)


def _disc(radius: float) -> Int64[np.ndarray, "k 2"]:
    """Cells around one, by their rows and columns from there."""
    side = np.arange(-int(radius), int(radius) + 1)
    both = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    return np.asarray(both[np.hypot(*both.T) <= radius])


def _inside(cells: Int64[np.ndarray, "k 2"], of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns, those beyond a map at its edge."""
    row, column = np.clip(cells, 0, np.array(of.shape) - 1).T
    return row, column


def through(views: Sequence[View], pose: Float64[np.ndarray, " 3"], walls: Barriers) -> float:
    """Share of the beams that pass through walls of the map on their way, seen from ``pose``.

    A beam passes where it and its neighbours, a cell to either side, meet the middle of a wall, and
    it gets well behind: away from any.
    """
    chart = walls.chart
    count, passed, cell = 0, 0, chart.resolution
    for view in views:
        at = compose(pose, view.pose)
        off = placed(view.surface, at)[:, :2] - at[:2]
        length = np.hypot(*off.T)
        steps = np.arange(NEAR, max(float(length.max(initial=0.0)), NEAR), cell)
        way = np.minimum(steps[None, :], np.maximum(length - NEAR, 0.0)[:, None])[..., None]
        ahead = (off / np.maximum(length, 1e-9)[:, None])[:, None]
        aside = cell * ahead[..., ::-1] * [-1.0, 1.0]
        places = [_places(at[:2] + way * ahead + k * aside, chart) for k in (-1, 0, 1)]
        met = [_there(walls.middle, place) for place in places]
        behind = np.logical_or.accumulate(met[1], axis=1)
        behind &= ~_there(walls.near, places[1]) & places[1][0]
        through_all = np.all([one.any(axis=1) for one in (*met, behind)], axis=0)
        count, passed = count + len(off), passed + int(through_all.sum())
    return passed / count if count else 0.0


def _places(at: np.ndarray, chart: Occupancy) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which of some places (…, 2) lie in the map, and the rows and columns of their cells."""
    column, row = (
        np.floor((at[..., k] - chart.origin[k]) / chart.resolution).astype(np.int64) for k in (0, 1)
    )
    rows, columns = chart.cells.shape
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    return inside, np.where(inside, row, 0), np.where(inside, column, 0)


def _there(values: np.ndarray, places: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    """What is in the cells of places; False outside."""
    inside, row, column = places
    return np.asarray(inside & values[row, column])


def stray(views: Sequence[View], pose: Float64[np.ndarray, " 3"], chart: Occupancy) -> float:
    """Share of the points that stand where the map is free, seen from ``pose``."""
    at = np.concatenate([placed(view.surface, compose(pose, view.pose))[:, :2] for view in views])
    walls = chart.walls()
    if not len(walls) or not len(at):
        return 0.0
    cell = np.floor((at - np.array(chart.origin)) / chart.resolution).astype(np.int64)
    inside = ((cell >= 0) & (cell < chart.cells.shape[::-1])).all(axis=1)
    column, row = np.where(inside[:, None], cell, 0).T
    far = scipy.spatial.cKDTree(walls).query(at)[0] > NEAR
    return float(np.mean(inside & (chart.cells[row, column] == FREE) & far))


class Charted(NamedTuple):
    """A map, made ready for scans to be looked for.

    >>> Charted._fields[:2]
    ('barriers', 'walls')
    """

    barriers: Barriers
    walls: Known
    drawing: Drawing
    tree: scipy.spatial.cKDTree
    window: _Window

    @classmethod
    def of(cls, chart: Occupancy) -> Charted:
        """The same for every scan."""
        walls, window = map_surface(chart), _Window.around(chart)
        size = math.ceil(2 * window.half / CELL) + 2 * BLUR + 2
        drawing = Drawing.of(walls, window.middle, size)
        return cls(
            Barriers.of(chart),
            Known.of(walls),
            drawing,
            scipy.spatial.cKDTree(walls[:, :2]),
            window,
        )


def located(views: Sequence[View], chart: Occupancy) -> Located:
    """The pose of a scan in a map, or of the first of several.

    Args:
        views: of one place; several tell more than one.
        chart: the map; a robot stands where it is free.
    """
    points, walls = sum(len(view.surface) for view in views), len(chart.walls())
    if points < FEW or not walls:
        return Located(None, None, 0.0, f"{points} points and {walls} walls are too few")
    return looked_for(views, Charted.of(chart))


def looked_for(views: Sequence[View], ready: Charted) -> Located:
    """The same in a map that is used for many."""
    scan = np.concatenate([placed(view.surface, view.pose) for view in views])
    if len(scan) < FEW:
        return Located(None, None, 0.0, f"{len(scan)} points are too few")
    barriers, known, drawing, tree, window = ready
    turns, middle = np.array([window.half, math.pi, TURN]), np.array([*window.middle, 0.0])
    bounds = Bounds.of(balanced(scan), drawing, turns, len(window.free), middle)

    def found(allowed: np.ndarray) -> tuple[Fit, float, float]:
        start, _ = bounds.search(allowed)
        fit = fitted(scan, known, Expected(start, VAGUE), start)
        off, _ = tree.query(placed(scan, fit.pose)[:, :2])
        return fit, float(np.mean(off < CLOSE)), through(views, fit.pose, barriers)

    (fit, share, passed), pose = (one := found(window.free)), one[0].pose
    if share < ALIKE:
        return Located(None, None, share, f"only {100 * share:.0f} % of the scan fits anywhere")
    if passed > PASSED:
        return Located(
            None, None, share, f"{100 * passed:.0f} % of the beams would pass through walls of the "
            "map: it is another place, or much was moved",
        )  # fmt: skip
    if math.sqrt(np.linalg.eigvalsh(fit.covariance[:2, :2])[-1]) > TOLD:
        return Located(None, None, share, "the scan leaves a direction open, as in a corridor")
    other, second, beyond = found(window.free * window.beyond(pose[:2]))
    if second - WALLS * beyond > share - WALLS * passed - CLEARLY:
        return Located(
            None, None, share, f"two places fit alike: {100 * share:.0f} % at ({pose[0]:.1f}, "
            f"{pose[1]:.1f}) m, {100 * second:.0f} % at ({other.pose[0]:.1f}, "
            f"{other.pose[1]:.1f}) m",
        )  # fmt: skip
    return Located(pose, fit.covariance, share)


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
