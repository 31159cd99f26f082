"""A cost map: how near to what stands there a machine may come.

A cell within an obstacle costs 100; one nearer to it than the machine's radius 99: its middle can
never be there. Beyond, the cost falls with the distance d by 98·exp(−k·(d − radius)), to 0 from the
inflation on, as ROS's ``costmap_2d`` has it. Obstacles are the occupied cells of the map and the
boxes around tables, which a lidar sees by their legs alone. Saved as ``map_server`` reads it, each
grey value the cost itself (``mode: raw``), 255 where nobody has seen.

>>> cells = np.full((20, 20), 254, np.uint8)
>>> cells[10, 10] = OCCUPIED
>>> cost = inflated(Occupancy(cells, 0.1, (0.0, 0.0)), [], Inflation(0.2, 0.5))
>>> cost.cells[10, 10:17].tolist()
[100, 99, 99, 36, 13, 5, 0]
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.errors import DataError
from evertwin.features.maps.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy, grey_of
from evertwin.types import Float64

LETHAL, INSCRIBED, DEAREST, UNSEEN = 100, 99, 98, 255
FALL = 10.0
"""How fast the cost falls [1/m]."""
CLEARED = 0.15
"""Around a leg that is gone [m]."""


class Inflation(NamedTuple):
    """How far around obstacles a machine pays.

    >>> Inflation(0.2, 0.6).radius
    0.2
    """

    radius: float
    """Of the machine [m]."""
    reach: float
    """From which distance on nothing is paid [m]."""


def inflated(
    chart: Occupancy, boxes: Iterable[Float64[np.ndarray, " 5"]], rule: Inflation
) -> Occupancy:
    """The costs around the walls of a map and around ``boxes`` (x, y, heading, length, width).

    In cells of the map; its cells hold costs, 0 to 100, 255 for not seen.
    """
    blocked = chart.cells == OCCUPIED
    row, column = np.indices(chart.cells.shape)
    x = (column + 0.5) * chart.resolution + chart.origin[0]
    y = (row + 0.5) * chart.resolution + chart.origin[1]
    for box in boxes:
        c, s = np.cos(box[2]), np.sin(box[2])
        along = c * (x - box[0]) + s * (y - box[1])
        across = c * (y - box[1]) - s * (x - box[0])
        blocked |= (np.abs(along) <= 0.5 * box[3]) & (np.abs(across) <= 0.5 * box[4])
    far = np.full(blocked.shape, np.inf)
    if blocked.any():
        far = scipy.ndimage.distance_transform_edt(~blocked) * chart.resolution
    cost = np.rint(DEAREST * np.exp(-FALL * np.maximum(far - rule.radius, 0.0)))
    cost[far > rule.reach + 1e-9] = 0.0
    cost[far <= rule.radius + 1e-9] = INSCRIBED
    cost[blocked] = LETHAL
    cost[(chart.cells == UNKNOWN) & (cost == 0)] = UNSEEN
    return Occupancy(cost.astype(np.uint8), chart.resolution, chart.origin)


def read_costs(file: Path) -> Occupancy:
    """The costs of a YAML file and its image, whose grey values they are.

    Raises:
        DataError: no such file, or it holds no costs.
    """
    keys, grey = grey_of(file)
    if keys.mode != "raw":
        raise DataError(f"{file}: expected costs (mode: raw), got a map: give costs.yaml")
    return Occupancy(grey.astype(np.uint8), keys.side, keys.origin)


def freed(
    chart: Occupancy, places: Float64[np.ndarray, "k 2"], radius: float = CLEARED
) -> Occupancy:
    """The map without what stood at ``places`` and is gone: cells within ``radius`` are free."""
    cells = chart.cells.copy()
    row, column = np.indices(cells.shape)
    x = (column + 0.5) * chart.resolution + chart.origin[0]
    y = (row + 0.5) * chart.resolution + chart.origin[1]
    for place in places:
        near = np.hypot(x - place[0], y - place[1]) < radius
        cells[near & (cells == OCCUPIED)] = FREE
    return chart._replace(cells=cells)
