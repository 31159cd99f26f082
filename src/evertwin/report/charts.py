"""A figure inside a page: vectors that follow the page's colours, and the values behind its lines.

What is drawn in black takes the colour of the text, and blue lines that of the page, so that a dark
page shows them; a small script of the page (``charts.js`` beside this file) tells the values under
the pointer and zooms.

>>> from matplotlib.figure import Figure
>>> figure = Figure(figsize=(4, 2))
>>> axes = figure.subplots()
>>> _ = axes.plot([0, 1, 2], [1.0, 3.0, 2.0], label="measured")
>>> _ = axes.set(xlabel="time [s]", ylabel="x [mm]")
>>> text = inline(figure, "x over time")
>>> text.startswith('<div class="plot"'), "http" in text, "measured" in text
(True, False, True)
"""

from __future__ import annotations

import io
import json
import re
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

POINTS = 4000
"""Points of a line whose values are told; of more, every second one, or third …"""
MARKS = 1500
"""Single marks that are drawn as vectors; more are a picture inside the picture."""
COLOURS = {"#000000": "currentColor", "#0072b2": "var(--line-blue, #0072b2)"}
"""Of a figure, and of the page."""
FORM: Any = {"svg.fonttype": "none", "svg.hashsalt": "evertwin"}


def inline(figure: Figure, label: str) -> Markup:
    """The figure as part of a page; ``label``: what it shows, for those who do not see it."""
    for axes in figure.axes:
        for line in axes.get_lines():
            if line.get_linestyle() == "None" and len(np.asarray(line.get_xydata())) > MARKS:
                line.set_rasterized(True)
    buffer = io.StringIO()
    with mpl.rc_context(FORM):
        figure.savefig(
            buffer, format="svg", transparent=True, dpi=150,
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )  # fmt: skip
    wide, high = (72.0 * float(size) for size in figure.get_size_inches())
    told = [known for axes in figure.axes if (known := _values(axes, wide, high))]
    data = json.dumps(told, separators=(",", ":"), allow_nan=False)
    svg = _cleaned(buffer.getvalue(), label)
    return Markup(
        f'<div class="plot" data-values="{escape(data)}"><div class="view">{svg}</div>'
        '<output class="values"></output></div>'
    )


def _cleaned(svg: str, label: str) -> str:
    """Without what HTML does not need: names of spaces, ids that nothing refers to, far digits."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', "", svg).replace("xlink:href", "href")
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', svg))
    svg = re.sub(r' id="([^"]+)"', lambda m: m.group(0) if m.group(1) in used else "", svg)
    svg = re.sub(r"(\d\.\d\d)\d+", r"\1", svg)
    for drawn, shown in COLOURS.items():
        svg = svg.replace(drawn, shown)
    svg = re.sub(r' (?:width|height)="[\d.]+pt"', "", svg, count=2)
    return svg.replace("<svg", f'<svg role="img" aria-label="{escape(label)}"', 1)


def _values(axes: Axes, wide: float, high: float) -> dict[str, Any]:
    """Where the axes lie in the picture [pt], what they span, and their lines; empty: untold."""
    linear = (axes.get_xscale(), axes.get_yscale()) == ("linear", "linear")
    lines = [line for line in axes.get_lines() if _tells(line)]
    if not linear or not lines:
        return {}
    place = axes.get_position()
    box = (place.x0 * wide, (1.0 - place.y1) * high, place.x1 * wide, (1.0 - place.y0) * high)
    return {
        "box": [round(edge, 1) for edge in box], "x": [float(v) for v in axes.get_xlim()],
        "along": axes.get_xlabel(), "unit": _unit(axes.get_ylabel()),
        "lines": [_line(line) for line in lines],
    }  # fmt: skip


def _tells(line: Line2D) -> bool:
    x = np.asarray(line.get_xdata(), dtype=np.float64)
    return not str(line.get_label()).startswith("_") and len(x) > 2 and bool(np.isfinite(x).any())


def _line(line: Line2D) -> dict[str, Any]:
    points = np.asarray(line.get_xydata(), dtype=np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    points = points[:: -(-len(points) // POINTS) or 1]
    points = points[np.argsort(points[:, 0], kind="stable")]
    x, y = ([float(f"{v:.6g}") for v in column] for column in points.T)
    return {"name": str(line.get_label()), "x": x, "y": y}


def _unit(label: str) -> str:
    found = re.search(r"\[([^\]]*)\]", label)
    return found.group(1) if found else ""
