"""The picture of a room with its tables: the cost map, the boxes, where they were moved from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from evertwin.features.maps.cost_map import UNSEEN
from evertwin.features.maps.occupancy import OCCUPIED, Occupancy
from evertwin.features.tables.rectangles import corners
from evertwin.features.tables.tables import Happened, Table
from evertwin.types import Float64

BOX, WAS, WAY = "#0072B2", "#D55E00", "#009E73"


def draw_tables(
    charts: tuple[Occupancy, Occupancy], tables: Sequence[Table], happened: Sequence[Happened],
    way: Float64[np.ndarray, "n 3"],
) -> Figure:  # fmt: skip
    """Costs in colour, walls and legs black, boxes blue with their number; moved ones by arrows.

    Args:
        charts: the map, and its costs.
        tables: that stand there.
        happened: what became of them.
        way: of the machine.
    """
    chart, costs = charts
    (x, y), (rows, columns) = chart.origin, chart.cells.shape
    extent = (x, x + columns * chart.resolution, y, y + rows * chart.resolution)
    figure = Figure(figsize=(8.0, 8.0 * min(max(rows / columns, 0.4), 1.6)), layout="constrained")
    axes = figure.subplots()
    axes.set_facecolor("0.85")
    shown = np.where(costs.cells == UNSEEN, np.nan, costs.cells)
    axes.imshow(shown, cmap="YlOrBr", vmin=0, vmax=130, origin="lower", extent=extent)
    wall = np.where(chart.cells == OCCUPIED, 1.0, np.nan)
    axes.imshow(wall, cmap="gray", vmin=1, vmax=2, origin="lower", extent=extent)
    axes.plot(way[:, 0], way[:, 1], color=WAY, lw=0.8, label="way")
    for table in tables:
        ring = corners(table.shape)[[0, 1, 2, 3, 0]]
        axes.plot(*ring.T, color=BOX, lw=1.5)
        axes.text(
            table.shape[0], table.shape[1], str(table.number), color=BOX, ha="center", va="center"
        )
    for one in happened:
        if one.what == "moved" and one.before is not None and one.now is not None:
            ring = corners(one.before)[[0, 1, 2, 3, 0]]
            axes.plot(*ring.T, color=WAS, lw=1.0, ls="--")
            axes.annotate("", xy=tuple(one.now[:2]), xytext=tuple(one.before[:2]),
                          arrowprops={"arrowstyle": "->", "color": WAS})  # fmt: skip
    axes.plot([], [], color=BOX, label="table")
    axes.plot([], [], color=WAS, ls="--", label="moved from")
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal",
             xlim=extent[:2], ylim=extent[2:])  # fmt: skip
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, ncols=3, frameon=False)
    return figure
