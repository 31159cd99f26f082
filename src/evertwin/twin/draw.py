"""Pictures of results, with Matplotlib. Nothing here opens a window: figures are returned.

Colours are those of Okabe and Ito, which colour-blind readers can tell apart; a mark or a dash says
the same as the colour.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from evertwin.models.form import Version
from evertwin.types import Vector

if TYPE_CHECKING:
    from evertwin.twin.result import RunResult

__all__ = ["draw_deviation", "draw_intervals", "draw_rounds", "draw_run", "draw_table"]

MEASURED, PREDICTED, UPDATE, BAND = "#000000", "#0072B2", "#D55E00", "#56B4E9"


def _figure(rows: int = 1, height: float = 2.2) -> tuple[Figure, Any]:
    figure = Figure(figsize=(9.0, height * rows), layout="constrained")
    return figure, figure.subplots(rows, 1, squeeze=False)[:, 0]


def _seconds(trace: Mapping[str, np.ndarray]) -> Vector:
    """Time from the start [s], without the gaps between tasks."""
    t = trace["t"] * 1e-9
    steps = np.diff(t, prepend=t[0])
    typical = float(np.median(steps[1:])) if len(steps) > 1 else 1.0
    opens = np.diff(trace["task"], prepend=trace["task"][0]) != 0
    return np.asarray(np.cumsum(np.where(opens | (steps < 0), typical, steps)))


def draw_run(result: RunResult, output: str | None = None) -> Figure:
    """Measured and predicted with position updates marked, and the residual with its band."""
    names = result.model.outputs.names
    k = 0 if output is None else names.index(output)
    trace, unit = result.trace, result.model.outputs.units[k]
    figure, (above, below) = _figure(2, 2.4)
    t = _seconds(trace)
    above.plot(t, trace["measured"][:, k], ".", ms=2, color=MEASURED, label="measured")
    above.plot(t, trace["predicted"][:, k], "-", lw=0.9, color=PREDICTED, label="predicted")
    updated = (trace["update"] == 1).any(axis=1)
    if updated.any():
        above.plot(
            t[updated], trace["measured"][updated, k], "x", color=UPDATE, ms=5,
            label=f"position update ({int(updated.sum())})",
        )  # fmt: skip
    above.set_ylabel(f"{names[k]} [{unit}]")
    above.legend(loc="upper left", fontsize=8, ncols=3)
    sigma = np.where(np.isfinite(trace["sigma"][:, k]), trace["sigma"][:, k], np.nan)
    below.fill_between(t, -1.96 * sigma, 1.96 * sigma, color=BAND, alpha=0.35, label="95 % band")
    below.plot(t, trace["residual"][:, k], "-", lw=0.7, color=MEASURED, label="residual")
    for row in _switches(result):
        at = t[min(int(np.searchsorted(trace["row"], row)), len(t) - 1)]
        for axis in (above, below):
            axis.axvline(at, color=UPDATE, ls="--", lw=1)
    below.set_ylabel(f"residual [{unit}]")
    below.set_xlabel("time [s]")
    below.legend(loc="upper left", fontsize=8, ncols=2)
    return figure


def _switches(result: RunResult) -> list[int]:
    return [e.row for e in result.events if e.kind in ("promoted", "rolled_back")]


def draw_deviation(result: RunResult, output: str, before: bool, most: int = 100) -> Figure:
    """Deviation of each measured position, samples over the tolerance marked.

    Before: the first champion over the last ``most`` measured samples; after: the last champion
    over the same.
    """
    k = result.model.outputs.names.index(output)
    trace, unit = result.trace, result.model.outputs.units[k]
    known = np.flatnonzero(np.isfinite(trace["measured"][:, k]))[-most:]
    predicted = trace["first" if before else "predicted"][known, k]
    updated = (trace["first_update" if before else "update"][known] == 1).any(axis=1)
    figure, (axis,) = _figure(1, 2.6)
    deviation = np.abs(trace["measured"][known, k] - predicted)
    place = np.arange(len(known))
    axis.bar(place[~updated], deviation[~updated], color=PREDICTED, label="within tolerance")
    axis.bar(
        place[updated], deviation[updated], color=UPDATE, hatch="//",
        label=f"position update ({int(updated.sum())})",
    )  # fmt: skip
    axis.set_ylabel(f"|deviation| [{unit}]")
    axis.set_xlabel("sample")
    axis.set_title("first model" if before else "present champion", fontsize=9)
    axis.legend(loc="upper left", fontsize=8, ncols=2)
    return figure


def draw_table(version: Version, unit: str) -> Figure | None:
    """The translation from set-point to effective value; None where the version has none."""
    values = dict(zip(version.names, version.values, strict=True))
    for term in version.form.terms:
        if term.kind != "table":
            continue
        levels = np.array(term.levels)
        learned = np.array([values[f"table.{term.channel}.{k}"] for k in range(len(levels))])
        figure, (axis,) = _figure(1, 3.0)
        axis.plot(levels, levels, ":", color=MEASURED, label="as commanded")
        axis.step(levels, learned, where="mid", color=PREDICTED, label="translation")
        axis.plot(levels, learned, "o", ms=3, color=PREDICTED)
        axis.set_xlabel(f"commanded {term.channel} [{unit}]")
        axis.set_ylabel(f"effective {term.channel} [{unit}]")
        axis.legend(fontsize=8)
        return figure
    return None


def draw_rounds(
    measured: np.ndarray, rounds: Sequence[np.ndarray], names: Sequence[str], t: Vector
) -> Figure:
    """Measured torque per axis and the prediction of the first and last round, (n, ny) each."""
    figure, axes = _figure(len(names), 1.5)
    for k, (axis, name) in enumerate(zip(axes, names, strict=True)):
        axis.plot(t, measured[:, k], ".", ms=1.5, color=MEASURED, label="measured")
        for number, predicted in enumerate(rounds):
            last = number == len(rounds) - 1
            axis.plot(
                t, predicted[:, k], "-" if last else ":", lw=1.2 if last else 0.8,
                color=PREDICTED if last else UPDATE, alpha=1.0 if last else 0.8,
                label=f"round {number}",
            )  # fmt: skip
        axis.set_ylabel(name, fontsize=8)
        axis.tick_params(labelsize=7)
    axes[0].legend(loc="upper right", fontsize=7, ncols=min(4, len(rounds) + 1))
    axes[-1].set_xlabel("time [s]")
    return figure


def draw_intervals(parameters: Mapping[str, Mapping[str, Any]]) -> Figure | None:
    """Values with their 95 % intervals; None where no parameter has one."""
    known = {
        name: item for name, item in parameters.items()
        if item.get("interval95") and None not in item["interval95"]
    }  # fmt: skip
    if not known:
        return None
    figure, (axis,) = _figure(1, 0.8 + 0.28 * len(known))
    for place, (name, item) in enumerate(reversed(known.items())):
        low, high = item["interval95"]
        size = max(abs(item["value"]), 1e-12)
        axis.plot([100 * (low - item["value"]) / size, 100 * (high - item["value"]) / size],
                  [place, place], "-", lw=3, color=BAND)  # fmt: skip
        axis.plot([0], [place], "o", ms=4, color=PREDICTED)
    axis.set_yticks(range(len(known)), list(reversed(known)), fontsize=8)
    axis.set_xlabel("95 % interval, % of the value")
    axis.axvline(0, color=MEASURED, lw=0.5)
    return figure
