"""Pictures of lives and plans, with Matplotlib; colours and marks as in `run_pictures`."""

from __future__ import annotations

from dataclasses import replace
from textwrap import fill, shorten
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evertwin.prognosis.laws import Indicator, Life
from evertwin.prognosis.laws.series.calendar import UNITS
from evertwin.prognosis.laws.series.life import LEVELS
from evertwin.prognosis.outlook.lives import ComponentLife
from evertwin.types import Vector

VALUE, COURSE, LIMIT, BAND, MARK = "#000000", "#0072B2", "#D55E00", "#56B4E9", "#009E73"
LAWS = ("#CC79A7", "#E69F00", "#009E73")
DASHES = ("--", ":", "-.")
WIDTH = 28
"""Letters of a component's name on one line."""
LEAST = 0.05
"""Weight below which a law is not drawn."""


def draw_indicator(one: ComponentLife) -> Figure:
    """History, limit, laws, band and maintenance above; the density of the end of life below."""
    indicator, life = _told(one.indicator), one.life
    known = isinstance(life, Life) and np.isfinite(life.median)
    figure = Figure(figsize=(9.0, 5.0 if known else 3.2), layout="constrained")
    shape: dict[str, Any] = {"height_ratios": [3, 1]} if known else {}
    axes = figure.subplots(2 if known else 1, 1, squeeze=False, sharex=True, gridspec_kw=shape)
    above = axes[0, 0]
    shown = np.isfinite(indicator.value)
    at, value, sigma = indicator.at[shown], indicator.value[shown], indicator.sigma[shown]
    half = np.where(np.isfinite(sigma), 1.96 * sigma, 0.0)
    bars, label = (half, "value, 95 %") if half.any() else (None, "value")
    above.errorbar(at, value, yerr=bars, fmt=".", ms=4, lw=0.6, color=VALUE, label=label, zorder=3)
    above.axhline(indicator.limit.value, color=LIMIT, ls="--", lw=1.3, label="limit")
    _marks(above, indicator)
    now = float(indicator.at[-1]) if len(at) else 0.0
    if isinstance(life, Life) and known:
        _course(above, one, now)
        _density(axes[1, 0], life, now)
    axes[-1, 0].set_xlabel(f"{'from now ' if indicator.clock in UNITS else ''}[{indicator.clock}]")
    above.axvline(now, color=VALUE, lw=0.6, ls=":")
    above.set_ylabel(fill(f"{indicator.name} [{indicator.unit}]", WIDTH))
    above.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, ncols=4, frameon=False,
                 borderaxespad=0.2)  # fmt: skip
    return figure


def _told(indicator: Indicator) -> Indicator:
    """On a clock of time as seen from now: hours since 1970 tell nobody anything."""
    if indicator.clock not in UNITS or not len(indicator.at):
        return indicator
    now = float(indicator.at[-1])
    marks = tuple(replace(mark, at=mark.at - now) for mark in indicator.maintenance)
    return indicator.with_(at=indicator.at - now, maintenance=marks)


def _marks(axis: Axes, indicator: Indicator) -> None:
    """Maintenance: a line, solid where a new life begins, dashed where the level shifts."""
    told = set()
    for mark in indicator.maintenance:
        style = "-" if mark.kind == "replaced" else "--"
        axis.axvline(mark.at, color=MARK, lw=1.2, ls=style,
                     label=None if mark.kind in told else mark.kind)  # fmt: skip
        told.add(mark.kind)
        axis.annotate(shorten(mark.note or mark.kind, WIDTH, placeholder=" …"), (mark.at, 0.97),
                      xycoords=("data", "axes fraction"), xytext=(-2, 0), rotation=90, va="top",
                      textcoords="offset points", ha="right", fontsize=7, color=MARK)  # fmt: skip


def _course(axis: Axes, one: ComponentLife, now: float) -> None:
    """Band, median and the single laws, from the newest value on."""
    if one.course is None:
        return
    times = now + one.course.times((0.1, 0.5, 0.9))
    reach = now + _reach(one)
    ends = np.where(np.isfinite(times), times, reach * 2.0)
    levels = one.course.levels
    axis.fill_betweenx(levels, ends[:, 0], np.minimum(ends[:, 2], reach * 2), color=BAND, alpha=0.3,
                       lw=0, label="course, 80 %")  # fmt: skip
    axis.plot(times[:, 1], levels, "-", color=COURSE, lw=1.6, label="course, median")
    weights = sorted(one.life.laws.items(), key=lambda pair: -pair[1])
    for k, (law, weight) in enumerate(weights[: len(LAWS)]):
        if law in one.by_law and weight >= LEAST:
            alone = one.by_law[law]
            axis.plot(now + alone.times((0.5,))[:, 0], alone.levels, DASHES[k], lw=1.0,
                      color=LAWS[k], label=f"{law}, weight {weight:.2f}")  # fmt: skip
    limit = one.indicator.limit.value
    axis.set_xlim(right=reach)
    values = one.indicator.value[np.isfinite(one.indicator.value)]
    span = np.array([*values, limit])
    room = 0.1 * float(np.ptp(span)) or 1.0
    axis.set_ylim(float(span.min()) - room, float(span.max()) + room)


def _reach(one: ComponentLife) -> float:
    """How far ahead is drawn: the 95 % end, or twice the median where that is far away."""
    life = one.life
    assert isinstance(life, Life)
    end = life.interval95[1]
    return min(end if np.isfinite(end) else 3.0 * life.median, 3.0 * life.median) * 1.05 + 1e-12


def _density(axis: Axes, life: Life, now: float) -> None:
    """Density of the end of life, its median and 80 % interval."""
    known = np.isfinite(life.remaining)
    t, density = _smooth(life.remaining[known])
    axis.fill_between(now + t, density, color=BAND, alpha=0.4, lw=0)
    axis.plot(now + t, density, color=COURSE, lw=1.0)
    low, high = life.interval80
    axis.axvline(now + life.median, color=COURSE, lw=1.6)
    ends = f"{high:.3g}" if np.isfinite(high) else "without end"
    axis.set_title(f"end of life: in {life.median:.3g} {life.unit} (80 %: {low:.3g} to {ends})",
                   fontsize=9, loc="left")  # fmt: skip
    for end in (low, high):
        if np.isfinite(end):
            axis.axvline(now + end, color=COURSE, lw=0.8, ls="--")
    axis.set_ylim(bottom=0.0)
    axis.set_ylabel("density")


def _smooth(remaining: Vector) -> tuple[np.ndarray, np.ndarray]:
    """Density from quantiles, on a grid."""
    levels = LEVELS[: len(remaining)]
    t = np.linspace(float(remaining[0]), float(remaining[-1]), 121)
    rising = remaining + 1e-9 * (remaining[-1] + 1e-12) * np.arange(len(remaining))
    share = np.interp(t, rising, levels)
    kernel = np.ones(7) / 7.0
    padded = np.pad(share, 3, mode="edge")
    density = np.gradient(np.convolve(padded, kernel, "valid"), t[1] - t[0] or 1.0)
    return t, np.maximum(density, 0.0)
