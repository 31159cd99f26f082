"""Some scans of a recording on one sheet: what each beam met, around the lidar."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from evertwin.sources.columns.scans import Scans

MOST = 6
"""Scans that are drawn, evenly chosen."""
WALL, LIDAR = "#0072B2", "#D55E00"


def draw_scans(recorded: Sequence[Scans]) -> Figure:
    """`MOST` scans of each lidar, three in a row; x [m] ahead of it, y [m] to its left."""
    chosen = [
        (scans, int(k))
        for scans in recorded
        for k in np.unique(np.linspace(0, len(scans.t) - 1, MOST).round())
    ]
    rows = -(-len(chosen) // 3)
    figure = Figure(figsize=(12.0, 4.0 * rows), layout="constrained")
    for place, (scans, k) in enumerate(chosen):
        axes, ranges = figure.add_subplot(rows, 3, place + 1), scans.ranges[k]
        angles = scans.lidar.angles(len(ranges))
        axes.plot(ranges * np.cos(angles), ranges * np.sin(angles), ".", color=WALL, ms=2.0)
        axes.plot(0.0, 0.0, "+", color=LIDAR)
        axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
        axes.set_title(f"{scans.name} {1e-9 * (scans.t[k] - scans.t[0]):.3f} s", fontsize=7)
    return figure
