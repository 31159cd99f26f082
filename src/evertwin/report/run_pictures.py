"""Pictures of results, with Matplotlib. Nothing here opens a window: figures are returned.

Colours are those of Okabe and Ito, which colour-blind readers can tell apart; a mark or a dash says
the same as the colour.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evertwin.signals import wrap
from evertwin.signals.spoken import suited
from evertwin.signals.units import conversion_of
from evertwin.types import Vector

if TYPE_CHECKING:
    from evertwin.outcome.result import RunResult

MEASURED, PREDICTED, UPDATE, BAND = "#000000", "#0072B2", "#D55E00", "#56B4E9"
ASKED = "#009E73"
NARROW = 6.0
"""Width of a picture [in] that holds two names beside each other."""
TINY = 1e-24
HALF = 0.5
"""Share of rows that tell it below which each is marked."""


def _figure(rows: int = 1, height: float = 2.2, wide: float = 9.0) -> tuple[Figure, Any]:
    figure = Figure(figsize=(wide, height * rows), layout="constrained")
    return figure, figure.subplots(rows, 1, squeeze=False)[:, 0]


def _legend(axis: Axes, wide: float = 9.0) -> None:
    """Above the axes, where it covers nothing; ``wide``: of the picture [in]."""
    axis.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, ncols=6 if wide > NARROW else 2,
        frameon=False, borderaxespad=0.2,
    )  # fmt: skip


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
    k = 0 if output is None else result.model.outputs.index(output)
    trace, unit, recorded = (
        result.trace,
        result.model.outputs.units[k],
        result.outputs[names[k]].recorded,
    )
    size, zero = conversion_of(recorded)
    apart, part = (unit, 1.0) if zero else (recorded or unit, size)  # K, of what is in degC
    measured, predicted = ((trace[v][:, k] - zero) / size for v in ("measured", "predicted"))
    figure, (above, below) = _figure(2, 2.4)
    t = _seconds(trace)
    above.plot(t, measured, ".", ms=2, color=MEASURED, label="measured")
    above.plot(t, predicted, "-", lw=0.9, color=PREDICTED, label="predicted")
    updated = trace["update"][:, int(result.model.outputs.group_of[k])] == 1
    if updated.any():
        above.plot(
            t[updated], measured[updated], "x", color=UPDATE, ms=5,
            label=f"position update ({int(updated.sum())})",
        )  # fmt: skip
    above.set_ylabel(f"{names[k]} [{recorded or unit}]")
    _legend(above)
    sigma, residual = trace["sigma"][:, k] / part, trace["residual"][:, k] / part
    sigma = np.where(np.isfinite(sigma), sigma, np.nan)
    below.fill_between(t, -1.96 * sigma, 1.96 * sigma, color=BAND, alpha=0.35, label="95 % band")
    known = np.isfinite(residual)
    below.plot(t[known], residual[known], "-", lw=0.7, color=MEASURED, label="residual")
    for row in _switches(result):
        at = t[min(int(np.searchsorted(trace["row"], row)), len(t) - 1)]
        for axis in (above, below):
            axis.axvline(at, color=UPDATE, ls="--", lw=1)
    below.set_ylabel(f"residual [{apart}]")
    below.set_xlabel("time [s]")
    _legend(below)
    return figure


def draw_improvement(
    result: RunResult, limits: Mapping[str, float], rows: int = 300, wide: float = 9.0
) -> Figure | None:
    """The output that gained most: measured, by the first and by the live version, and what
    predictions are off by where they have reached their horizon, as the figures have it.

    A typical stretch of the rows since the last switch, which neither had learned from; None:
    there are none. ``limits``: what each output may be off by; ``wide``: of the picture [in].
    """
    gains = {
        name: f.after / f.before
        for name, f in result.outputs.items() if f.before > 0 and f.after >= 0
    }  # fmt: skip
    if not gains:
        return None
    name = min(gains, key=gains.__getitem__)
    outputs, trace = result.model.outputs, result.trace
    k = outputs.names.index(name)
    unseen = (trace["row"] >= result.unseen_since) & np.isfinite(trace["measured"][:, k])
    unseen &= np.isfinite(trace["first"][:, k]) & np.isfinite(trace["predicted"][:, k])
    if not unseen.any():
        return None
    measured, angle = trace["measured"][:, k, None], outputs.angles[k : k + 1]
    away = {v: wrap(measured - trace[v][:, k, None], angle)[:, 0] for v in ("first", "predicted")}
    turned = trace["predicted"][:, k] + away["predicted"]
    judged = trace["moving"][:, k]  # of what stands nothing is judged
    off = {
        v: np.where(judged, trace[c][:, k], np.nan)
        for v, c in (("first", "off_first"), ("predicted", "off"))
    }
    at = _typical(np.stack(list(off.values())), np.flatnonzero(unseen), rows)
    figure, (above, below) = _figure(2, 2.2, wide)
    t = _seconds(trace)[at]
    one = result.outputs[name]
    size, zero = conversion_of(one.recorded)
    above.plot(t, (turned[at] - zero) / size, ".", ms=3, color=MEASURED, label="measured")
    now = "live" if result.champion.number else "as configured"
    versions = [("first", "as configured", UPDATE, "--"), ("predicted", now, PREDICTED, "-")]
    unit, factor = suited(one.before, one.unit, one.recorded)
    for column, label, colour, style in versions if gains[name] != 1.0 else versions[1:]:
        predicted = (turned[at] - away[column][at] - zero) / size
        above.plot(t, predicted, style, lw=1.1, color=colour, label=label)
        # the rows on the way to a horizon are passed over, what stands is a gap
        told = np.isfinite(off[column][at]) | ~judged[at]
        below.plot(
            t[told], factor * off[column][at][told], style, lw=1.1, color=colour, label=label,
            marker="." if told.mean() < HALF else "",
        )  # fmt: skip
    below.axhline(0.0, color=MEASURED, lw=0.6)
    asked = factor * limits.get(name, np.nan)
    for edge in (asked, -asked) if np.isfinite(asked) else ():
        below.axhline(edge, color=ASKED, ls=":", lw=1.2)
    if np.isfinite(asked):
        above.plot([], [], ":", color=ASKED, lw=1.2, label=f"asked: {asked:.3g} {unit} (rms)")
    below.set_xlim(above.get_xlim())  # one time axis, though rows that stand are in one alone
    above.set_ylabel(f"{name} [{one.recorded or one.unit}]")
    below.set_ylabel(f"off by [{unit}]")
    below.set_xlabel("time [s]")
    _legend(above, wide)
    return figure


def _typical(off: np.ndarray, places: np.ndarray, rows: int) -> np.ndarray:
    """Of stretches of so many places the one whose rms are nearest to those of all, and of which as
    much is known; the newest."""
    starts = range(max(len(places) - rows, 0), -1, -max(rows // 4, 1))
    square, known = np.nan_to_num(off**2), np.isfinite(off)

    def told(one: np.ndarray) -> np.ndarray:
        count = known[:, one].sum(axis=1)
        size = square[:, one].sum(axis=1) / np.maximum(count, 1)
        return np.concatenate([size + TINY, (count + 1) / len(one)])

    whole = told(places)

    def strange(start: int) -> float:
        return float(np.abs(np.log(told(places[start : start + rows]) / whole)).sum())

    best = min(starts, key=strange)
    return places[best : best + rows]


def _switches(result: RunResult) -> list[int]:
    return [e.row for e in result.events if e.kind in ("promoted", "rolled_back")]


def draw_deviation(result: RunResult, output: str, before: bool, limit: float) -> Figure:
    """Deviation of the newest 100 measured samples; those that made a position update are marked.

    Before: the first champion; after: the last one, over the same samples. ``limit`` is the
    tolerance, in the output's unit.
    """
    k = result.model.outputs.names.index(output)
    group = int(result.model.outputs.group_of[k])
    trace, unit = result.trace, result.model.outputs.units[k]
    known = np.flatnonzero(np.isfinite(trace["measured"][:, k]))[-100:]
    updated = trace["first_update" if before else "update"][known, group] == 1
    deviation = np.abs(
        trace["measured"][known, k] - trace["first" if before else "predicted"][known, k]
    )
    figure, (axis,) = _figure(1, 2.6)
    place = np.arange(len(known))
    axis.bar(place[~updated], deviation[~updated], color=PREDICTED, label="no update")
    if updated.any():
        axis.bar(
            place[updated], deviation[updated], color=UPDATE, hatch="//",
            label=f"position update ({int(updated.sum())})",
        )  # fmt: skip
    if np.isfinite(limit):
        axis.axhline(limit, color=MEASURED, ls="--", lw=1, label=f"tolerance {limit:g} {unit}")
    axis.set_ylabel(f"|deviation| of {output} [{unit}]")
    axis.set_xlabel("measured sample, newest last")
    _legend(axis)
    return figure


def draw_table(table: Mapping[str, Any], unit: str) -> Figure:
    """The translation from set-point to effective value; open dots where nothing was seen."""
    levels, values = np.array(table["levels"]), np.array(table["values"])
    learned = np.array(table["learned"], dtype=np.bool_)
    figure, (axis,) = _figure(1, 3.4)
    axis.plot(levels, levels, ":", color=MEASURED, label="as commanded")
    axis.step(levels, values, where="mid", color=PREDICTED, lw=1, label="translation")
    axis.plot(levels[learned], values[learned], "o", ms=4, color=PREDICTED, label="learned")
    axis.plot(levels[~learned], values[~learned], "o", ms=4, mfc="none", color=UPDATE,
              label="not seen")  # fmt: skip
    axis.set_xlabel(f"set-point {table['channel']} [{unit}]")
    axis.set_ylabel(f"simulated with [{unit}]")
    _legend(axis)
    return figure


def draw_rounds(
    measured: np.ndarray, rounds: Sequence[tuple[str, np.ndarray]], names: Sequence[str], t: Vector
) -> Figure:
    """Measured outputs and the prediction of each round (label, (n, ny)), one axis an output."""
    figure, axes = _figure(len(names), 1.7)
    for k, (axis, name) in enumerate(zip(axes, names, strict=True)):
        axis.plot(t, measured[:, k], ".", ms=2, color=MEASURED, label="measured")
        for number, (label, predicted) in enumerate(rounds):
            last = number == len(rounds) - 1
            share = number / max(len(rounds) - 1, 1)
            axis.plot(
                t, predicted[:, k], "-" if last else "--", lw=1.3 if last else 0.8,
                color=PREDICTED if last else UPDATE, alpha=1.0 if last else 1.0 - 0.6 * share,
                label=label,
            )  # fmt: skip
        axis.set_ylabel(name, fontsize=8)
        axis.set_xlim(float(t[0]), float(t[-1]) or 1.0)
        axis.tick_params(labelsize=7)
    _legend(axes[0])
    axes[-1].set_xlabel("time [s]")
    return figure
