"""The pictures of a study: the machine's tree, who sees what, sensitivity, schedule."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Patch

from evertwin.engineering.study import Study
from evertwin.engineering.weights import Measured, Weighed
from evertwin.tuning import Schedule

FILL = {"white": "white", "grey": "0.8", "black": "0.25"}
INK = {"white": "black", "grey": "black", "black": "white"}
TUNED, KEPT, LINE = "#1f6fb4", "#b9c4cf", "#c0392b"
COLUMNS = (0.0, 1.5, 3.3, 5.0)
"""Where machine, systems, sub-systems and components stand."""
BOX = (2.2, 0.62)
"""Width and height of a component."""
ROW = 0.27
"""Inches a row."""


def draw_tree(study: Study) -> Figure:
    """The machine as a tree: depth of the models as fill, criticality as border and bar."""
    places = study.breakdown.studied
    known = {one.component: one for one in study.ranks}
    depth = {one.component: one.level for one in study.levels}
    figure = Figure(figsize=(10, 0.9 + ROW * len(places)), layout="constrained")
    axes = figure.subplots()
    rows: dict[tuple[str, ...], list[float]] = {}
    for row, place in enumerate(places):
        y = -float(row)
        for path in ((), (place.system,), (place.system, place.subsystem)):
            rows.setdefault(path, []).append(y)
        one = known[place.component.name]
        _component(axes, place.component.name, y, depth[one.component], one.role == "critical")
        _score(axes, one.score, y, one.role == "critical")
        own = (place.system, place.subsystem) if place.subsystem else (place.system,)
        _edge(axes, len(own), float(np.mean(_span(places, own))), 3, y)
    _inner(axes, study.breakdown.name, rows)
    border = 7.5 + study.breakdown.critical_from / 10
    axes.plot([border, border], [0.6, 0.4 - len(places)], color=LINE, linewidth=0.8, linestyle=":")
    axes.text(7.5, 1.1, "effect × proneness", fontsize=8)
    axes.set_xlim(-0.7, 10.4)
    axes.set_ylim(-len(places) + 0.3, 2.6)
    axes.axis("off")
    handles = [Patch(facecolor=FILL[n], edgecolor="0.3", label=f"{n} box") for n in FILL]
    handles += [Patch(facecolor="white", edgecolor=LINE, linewidth=1.6, label="critical")]
    axes.legend(handles=handles, ncols=4, frameon=False, fontsize=8, loc="upper left")
    return figure


def _span(places: Any, own: tuple[str, ...]) -> list[float]:
    """Heights of the components below a system or sub-system."""
    return [-float(k) for k, p in enumerate(places) if (p.system, p.subsystem)[: len(own)] == own]


def _inner(axes: Axes, name: str, rows: dict[tuple[str, ...], list[float]]) -> None:
    """Machine, systems and sub-systems, each at the middle of what is below."""
    at = {path: float(np.mean(ys)) for path, ys in rows.items() if path == () or path[-1]}
    for path, y in at.items():
        text = path[-1] if path else name
        weight = "bold" if not path else "normal"
        frame = {"facecolor": "#eef3f8", "edgecolor": "0.6", "boxstyle": "round,pad=0.25"}
        axes.text(COLUMNS[len(path)], y, text, ha="center", va="center", fontsize=8.5,
                  weight=weight, zorder=3, bbox=frame)  # fmt: skip
        if path:
            _edge(axes, len(path) - 1, at[path[:-1]], len(path), y)


def _edge(axes: Axes, left: int, y0: float, right: int, y1: float) -> None:
    x0, x1 = COLUMNS[left], COLUMNS[right]
    bend = x1 - (1.0 if right == 3 and left < 2 else 0.55)
    axes.plot([x0, bend, bend, x1], [y0, y0, y1, y1], color="0.7", linewidth=0.8, zorder=1)


def _component(axes: Axes, name: str, y: float, level: str, critical: bool) -> None:
    edge, wide = (LINE, 1.8) if critical else ("0.4", 0.8)
    x = COLUMNS[3]
    axes.add_patch(
        FancyBboxPatch((x, y - BOX[1] / 2), BOX[0], BOX[1], boxstyle="round,pad=0.02",
                       facecolor=FILL[level], edgecolor=edge, linewidth=wide, zorder=2)
    )  # fmt: skip
    axes.text(x + BOX[0] / 2, y, name, ha="center", va="center", fontsize=8, color=INK[level],
              zorder=3)  # fmt: skip


def _score(axes: Axes, score: float, y: float, critical: bool) -> None:
    axes.barh(y, score / 10, left=7.5, height=0.5, color=LINE if critical else "0.7", alpha=0.8)
    axes.text(7.55 + score / 10, y, f"{score:.1f}", va="center", fontsize=7.5)


def draw_map(study: Study) -> Figure:
    """Who sees what: effect of each parameter on each signal, from the model."""
    outputs = sorted({s.signal for link in study.links for s in link.signals})
    effect = np.full((len(study.links), max(len(outputs), 1)), np.nan)
    for k, link in enumerate(study.links):
        for signal in link.signals:
            effect[k, outputs.index(signal.signal)] = 100 * signal.effect
    figure = Figure(
        figsize=(min(3.5 + 0.8 * len(outputs), 10), 1.0 + 0.24 * len(study.links)),
        layout="constrained",
    )
    axes = figure.subplots()
    shown = axes.imshow(
        np.log10(effect), aspect="auto", cmap="Blues", vmin=-2.0, vmax=2.0, interpolation="none"
    )
    for (k, o), value in np.ndenumerate(effect):
        if np.isfinite(value):
            ink = "white" if value > 10 else "black"
            axes.text(o, k, f"{value:.2g}", ha="center", va="center", fontsize=7, color=ink)
    axes.set_xticks(range(len(outputs)), outputs)
    axes.set_yticks(range(len(study.links)), [link.parameter for link in study.links])
    axes.tick_params(labelsize=8, length=0)
    bar = figure.colorbar(shown, ax=axes, ticks=[-2, -1, 0, 1, 2], shrink=0.6)
    bar.ax.set_yticklabels(["0.01", "0.1", "1", "10", "100"])
    bar.set_label("change of the signal, % of its rms,\nwhen the parameter doubles", fontsize=8)
    return figure


def draw_sensitivity(study: Study) -> Figure:
    """Sobol shares of what may drift, against the limit; Morris' effects of all parameters."""
    names = list(study.morris.names)
    tuned = set(study.chosen.editable)
    colours = [TUNED if name in tuned else KEPT for name in names]
    figure = Figure(figsize=(10, 1.1 + 0.24 * len(names)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    y = np.arange(len(names))
    chosen = {one.name: one for one in study.chosen.choices}
    share = np.array([np.nan if chosen[n].share is None else chosen[n].share for n in names])
    half = np.array([chosen[n].share_half for n in names])
    left.barh(y, np.nan_to_num(share), xerr=half, color=colours, error_kw={"lw": 0.8})
    limit = study.breakdown.requirements.negligible
    for k in np.flatnonzero(np.isnan(share)):
        left.text(limit + 0.02, k, chosen[names[k]].verdict, va="center", fontsize=7, color="0.35")
    left.axvline(limit, color=LINE, linestyle="--", linewidth=1.0)
    left.set_xlabel(f"largest Sobol share of an output (dashed: negligible, {limit:g})", fontsize=8)
    left.set_yticks(y, names)
    left.set_xlim(0.0, 1.1)
    left.set_ylim(len(names) - 0.4, -0.6)
    right.barh(y, 100 * study.morris.mu.max(axis=0), color=colours,
               xerr=100 * study.morris.spread.max(axis=0), error_kw={"lw": 0.8})  # fmt: skip
    right.set_xlabel("Morris: change over the whole range, % of the output's rms", fontsize=8)
    for axes in (left, right):
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    handles = [Patch(color=TUNED, label="tuned"), Patch(color=KEPT, label="kept")]
    right.legend(handles=handles, frameon=False, fontsize=8)
    return figure


def draw_schedule(weighed: Weighed, measured: Measured) -> Figure:
    """Which parameter has its turn at which tuning."""
    schedule = Schedule(weighed.weights)
    names, turns = list(weighed.weights), measured.tunings
    figure = Figure(figsize=(10, 1.0 + 0.26 * len(names)), layout="constrained")
    axes = figure.subplots()
    for turn in range(turns):
        due = set(schedule.due(turn))
        for k, name in enumerate(names):
            on = name in due
            axes.plot(turn, k, "s", color=TUNED if on else "0.9", markersize=7 if turns < 60 else 4)
    axes.set_yticks(range(len(names)), [f"{n}  ({weighed.weights[n]:.2g})" for n in names])
    axes.set_xlabel("tuning", fontsize=8)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(labelsize=8, length=0)
    axes.spines[["top", "right", "left", "bottom"]].set_visible(False)
    return figure


def draw_deviation(measured: Measured, limit: float) -> Figure:
    """The largest deviation of each output with everything tuned, and by the schedule."""
    names = list(measured.deviation)
    figure = Figure(figsize=(10, 2.4), layout="constrained")
    axes = figure.subplots()
    x = np.arange(len(names))
    for shift, found, label, colour in (
        (-0.2, measured.deviation_all, "everything at every turn", KEPT),
        (0.2, measured.deviation, "by the schedule", TUNED),
    ):
        axes.bar(x + shift, [100 * found[n] for n in names], 0.38, label=label, color=colour)
    axes.axhline(100 * limit, color=LINE, linestyle="--", linewidth=1.0, label="requirement")
    axes.set_xticks(x, names)
    axes.set_ylabel("largest deviation, %", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_ylim(
        0, 140 * max(limit, *measured.deviation.values(), *measured.deviation_all.values())
    )
    axes.legend(frameon=False, fontsize=8, ncols=3)
    return figure
