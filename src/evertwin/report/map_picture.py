"""The picture of a map: what is occupied and free, and the way through it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from evertwin.features.maps.occupancy import Occupancy
from evertwin.features.scans.poses import Fix, Poses

WAY, LOST, START = "#0072B2", "#D55E00", "#009E73"


def draw_map(chart: Occupancy, poses: Poses) -> Figure:
    """The map with the lidar's way; where it was lost the way is broken off, by a cross."""
    x, y = chart.origin
    rows, columns = chart.cells.shape
    extent = (x, x + columns * chart.resolution, y, y + rows * chart.resolution)
    figure = Figure(figsize=(8.0, 8.0 * min(max(rows / columns, 0.4), 1.6)), layout="constrained")
    axes = figure.subplots()
    axes.imshow(chart.cells, cmap="gray", vmin=0, vmax=255, origin="lower", extent=extent)
    way = np.where((poses.segment == 0)[:, None], poses.pose, np.nan)
    axes.plot(way[:, 0], way[:, 1], color=WAY, lw=0.8, label="way")
    told = np.flatnonzero(np.isfinite(way[:, 0]))
    axes.plot(*way[told[0], :2], "o", color=START, label="start")
    lost = np.flatnonzero(np.diff((poses.fix == Fix.LOST).astype(np.int64)) == 1)
    if len(lost):
        axes.plot(way[lost, 0], way[lost, 1], "x", color=LOST, label="lost")
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, ncols=3, frameon=False)
    return figure
