"""Factors, signs and lags: does what is measured follow what is predicted?

Where predicted and measured changes do not agree, each channel (and each set of channels with the
same unit) is multiplied in turn by the factors that wrong units make, and by −1. The one that
brings prediction and measurement together best is named, applied, and the search goes on with the
rest. Lags are looked for only where units agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from evertwin.doctor.examination import View, changes
from evertwin.doctor.finding import Finding
from evertwin.fold import Block, take
from evertwin.loop.channels import recorded_as
from evertwin.models import roll
from evertwin.models.function import kernel_of
from evertwin.signals import Layout
from evertwin.signals.delay import Lag
from evertwin.sync.horizon import restarts, trusted
from evertwin.sync.lag import SharedLag, shared_lag
from evertwin.types import Vector

FACTORS: tuple[tuple[float, str], ...] = (
    (-1.0, "-1 (the sign is reversed)"),
    *((10.0**n, f"10^{n}") for n in (1, -1, 2, -2, 3, -3, 6, -6)),
    (math.pi / 180, "pi/180 (degrees taken for radians)"),
    (180 / math.pi, "180/pi (radians taken for degrees)"),
    (25.4, "25.4 (inches taken for millimetres)"),
    (1 / 25.4, "1/25.4 (millimetres taken for inches)"),
    (60.0, "60 (per second and per minute)"), (1 / 60, "1/60 (per second and per minute)"),
    (3.6, "3.6 (m/s and km/h)"), (1 / 3.6, "1/3.6 (m/s and km/h)"),
)  # fmt: skip
"""What a recording has to be multiplied by, and what that stands for."""
WRONG, BETTER = 0.6, 0.5
"""Mismatch from which units are doubted, and the share of it that a factor must remove."""
ROWS = 3000
"""Rows that factors are tried on."""


@dataclass(frozen=True)
class _Suspect:
    """Columns that are scaled together."""

    names: tuple[str, ...]
    u: tuple[int, ...]
    y: tuple[int, ...]


def look_units(view: View, figures: dict[str, Any]) -> list[Finding]:
    """Channels whose unit or sign does not fit the model."""
    found = list(_ranges(view))
    window = _liveliest(view)
    at_start = _mismatch(view, window)
    figures["mismatch"] = dict(zip(view.model.outputs.names, at_start.tolist(), strict=True))
    for _ in range(4):
        before = _mismatch(view, window)
        if not (before > WRONG).any():
            break
        best = _best(view, window, before)
        if not best:
            break
        found.append(_told(view, best, before))
        window = _scaled(window, best[0].suspect, best[0].factor)
    return found


class _Hypothesis(NamedTuple):
    """A factor on some channels, and the mismatch that it leaves."""

    suspect: _Suspect
    factor: float
    said: str
    after: Vector

    @property
    def text(self) -> str:
        return f"{', '.join(self.suspect.names)} times {self.said}"


def _told(view: View, best: list[_Hypothesis], before: Vector) -> Finding:
    first, outputs = best[0], view.model.outputs.names
    better = [k for k in range(len(outputs)) if first.after[k] < 0.9 * before[k]]
    shown = ", ".join(f"{outputs[k]} {before[k]:.2f} -> {first.after[k]:.2f}" for k in better)
    names = " or ".join(", ".join(one.suspect.names) for one in best)
    sign = first.factor < 0
    step = (
        f"scale = -1 for {names} in [source.channels], if its direction is confirmed"
        if sign
        else f"check the unit of {names} in [source.channels]"
    )
    return Finding(
        "sign" if sign else "unit", first.suspect.names[0],
        f"{', or '.join(one.text for one in best)} fits the model: mismatch {shown}",
        "[source.channels]", step,
        {
            "before": before, "after": first.after,
            "hypotheses": [
                {"channels": one.suspect.names, "factor": one.said.split()[0]} for one in best
            ],
        },
    )  # fmt: skip


def _ranges(view: View) -> Iterator[Finding]:
    """Values that no machine has in the unit that is declared."""
    spec = view.setup.spec
    stated = {name: c.unit for source in spec.source for name, c in source.channels.items()}
    stated |= {one.name: "computed" for one in spec.derive}
    for layout, columns in (
        (view.model.inputs, [w.u for w in view.windows]),
        (view.model.outputs, [w.y for w in view.windows]),
    ):
        values = np.concatenate(columns)
        for k, channel in enumerate(layout):
            known = values[np.isfinite(values[:, k]), k]
            if len(known) == 0:
                continue
            low, high = float(known.min()), float(known.max())
            size = max(abs(low), abs(high))
            hint = ""
            if channel.unit == "K" and high < 150:
                hint = "degrees Celsius taken for kelvin: unit = 'degC'"
            elif stated.get(recorded_as(spec, channel.name), "") not in ("", channel.unit):
                continue  # it was converted from a unit that somebody gave
            elif channel.unit == "rad/s" and size > 60:
                hint = "degrees taken for radians (pi/180)? unit = 'deg/s'"
            elif channel.unit == "rad" and channel.kind == "angle" and size > 50:
                hint = "degrees taken for radians (pi/180)? unit = 'deg'"
            if hint:
                yield Finding(
                    "unit", channel.name,
                    f"{channel.name} reaches from {low:.4g} to {high:.4g} {channel.unit}",
                    "[source.channels]", hint, {"low": low, "high": high},
                )  # fmt: skip


def _liveliest(view: View) -> Block:
    """The stretch of a window in which the inputs change most, `ROWS` long at most."""
    best, size = view.windows[0], -1.0
    spread = np.nanstd(np.concatenate([w.u for w in view.windows]), axis=0) + 1e-300
    for window in view.windows:
        for start in range(0, len(window.t), ROWS):
            piece = take(window, start, min(start + ROWS, len(window.t)))
            if len(piece.t) < 2:
                continue
            moved = float(np.nansum(np.nanstd(piece.u, axis=0) / spread)) * math.sqrt(len(piece.t))
            if moved > size:
                best, size = piece, moved
    return best._replace(y=np.where(np.isfinite(best.y), best.y, np.nan))


def _mismatch(view: View, window: Block) -> Vector:
    with np.errstate(all="ignore"):
        return changes(view.model, view.version.p, window, view.horizon).mismatch


def _scaled(window: Block, suspect: _Suspect, factor: float) -> Block:
    u, y = window.u.copy(), window.y.copy()
    u[:, suspect.u] *= factor
    y[:, suspect.y] *= factor
    return window._replace(u=u, y=y)


def _suspects(inputs: Layout, outputs: Layout) -> list[_Suspect]:
    """Single channels first, then channels that share a unit."""
    out = [_Suspect((name,), (k,), ()) for k, name in enumerate(inputs.names)]
    out += [_Suspect((name,), (), (k,)) for k, name in enumerate(outputs.names)]
    for layout, side in ((inputs, "u"), (outputs, "y")):
        for unit in dict.fromkeys(layout.units):
            where = tuple(k for k, other in enumerate(layout.units) if other == unit)
            if len(where) > 1:
                names = tuple(layout.names[k] for k in where)
                u, y = (where, ()) if side == "u" else ((), where)
                out.append(_Suspect(names, u, y))
    return out


def _best(view: View, window: Block, before: Vector) -> list[_Hypothesis]:
    """What removes most, and what explains it as well; empty where nothing removes enough."""
    wrong = before > WRONG
    found = []
    for suspect in _suspects(view.model.inputs, view.model.outputs):
        if suspect.y and not wrong[list(suspect.y)].all():
            continue
        for factor, said in FACTORS:
            after = _mismatch(view, _scaled(window, suspect, factor))
            helped = (after < BETTER * before) & wrong
            if helped.any() and (after <= before + 0.1).all():
                found.append(_Hypothesis(suspect, factor, said, after))
    if not found:
        return []
    least = min(float(one.after.sum()) for one in found)
    # the channel alone before a set of channels: suspects come in that order
    close = [one for one in found if float(one.after.sum()) <= 1.05 * least + 0.01]
    return close[:3]


def look_lags(view: View, figures: dict[str, Any]) -> Iterator[Finding]:
    """How late each output is after its prediction by a free run."""
    window = max(view.judged, key=lambda one: len(one.t))
    window = take(window, 0, min(len(window.t), 20_000))
    model, p = view.model, view.version.p
    kernel = kernel_of(model)
    x0 = model.initial(p)
    _, free = roll(kernel, x0, window.u, window.dt, p, restarts(window, math.inf, x0))
    shared = shared_lag(window, free, model.outputs, _longest(window))
    lags = {name: one for name, one in shared.lags.items() if math.isfinite(one.seconds)}
    figures["lag"], figures["shared_lag"] = lags, stated(shared)
    late = {name: one for name, one in lags.items() if _matters(one, view.step)}
    if not late:
        return
    shown = ", ".join(
        f"{n} {1e3 * o.seconds:.0f} ± {1960 * o.sigma:.0f} ms" for n, o in late.items()
    )
    common = len(late) == len(lags) > 1
    yield Finding(
        "lag", next(iter(late)),
        f"measured after predicted by {shown}" + (": common to all outputs" if common else ""),
        f"rows {window.row} to {window.row + len(window.t) - 1}",
        "a transport lag: give [[source]] offset where a clock is off, else allow 'lag' in "
        "[correction] terms or a delay parameter of the model; a lag that is left in is learned "
        "as a false table",
        {name: {"seconds": o.seconds, "sigma": o.sigma} for name, o in late.items()},
    )  # fmt: skip


def _matters(found: Lag, step: float) -> bool:
    sure = found.verdict == "identified" and found.correlation > 0.9
    return sure and abs(found.seconds) > max(4 * found.sigma, 0.5 * step)


def _longest(window: Block) -> float:
    """Lags that are looked at: up to 20 intervals of the output that is measured least often."""
    stamps = [window.t[np.isfinite(column)] for column in trusted(window).T]
    steps = [float(np.median(np.diff(t))) * 1e-9 for t in stamps if len(t) >= 50]
    return min(20 * max(steps, default=0.0), float(window.t[-1] - window.t[0]) * 1e-9 / 8)


def stated(lag: SharedLag) -> dict[str, Any]:
    """The lag of all outputs as figures."""
    return {key: getattr(lag, key) for key in ("seconds", "interval95", "agree", "reason")}
