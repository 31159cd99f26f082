"""Factors, signs and lags: does what is measured follow what is predicted?

Where predicted and measured changes do not agree, each channel (and each set of channels with the
same unit) is multiplied in turn by the factors that wrong units make, and by −1. The one that
brings prediction and measurement together best is named, applied, and the search goes on with the
rest. Lags are looked for only where units agree.

What a number of a static map takes up that may be tuned tells nothing: a mass that nobody stated is
no wrong unit, and no lag. So its numbers are tuned first, with a turned sign and at each lag anew;
those of a model with states where a lag shows, since a wrong time constant looks like one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from evertwin.doctor.check_numbers import changed, not_tuned, tuned
from evertwin.doctor.crossed_outputs import look_crossed
from evertwin.doctor.examination import View
from evertwin.doctor.factors import Factor, Hypothesis, scaled, suspects
from evertwin.doctor.finding import Finding
from evertwin.fold import Block, take
from evertwin.gauges.delays.clock_unit import stamped_in
from evertwin.gauges.delays.late_scans import late_scans, said_late
from evertwin.gauges.rows.scanned import pose_of, rule_of
from evertwin.gauges.rows.unlike import Changes
from evertwin.gauges.units.misread import ANSWERED, likeliest
from evertwin.gauges.units.turned import WRONG as ASKEW
from evertwin.gauges.units.turned import Numbered, angles_of, turned
from evertwin.models import roll
from evertwin.models.functions.function import kernel_of
from evertwin.rows.channels import recorded_as, unit_recorded
from evertwin.signals.delay import Lag
from evertwin.sync.horizon.horizon import restarts, trusted
from evertwin.sync.horizon.lag import SharedLag, shared_lag
from evertwin.types import ParameterVector, Vector

WRONG, BETTER = 0.6, 0.5
"""Mismatch from which units are doubted, and the share of it that a factor must remove."""
MOST = 0.9
"""Mismatch from which on numbers are doubted that no factor mends."""
ROWS = 3000
"""Rows that factors are tried on."""
_Numbers: TypeAlias = Callable[[View, Callable[[Block], Block]], ParameterVector]
JOINT, SHAFT = 60.0, 1000.0
"""Speed [rad/s] that no joint of a static map turns at, whose angle is a channel; and no motor."""
ROUNDS = 5
"""Times that numbers are tuned anew at a lag that was found."""


def look_units(view: View, figures: dict[str, Any]) -> list[Finding]:
    """Channels whose unit or sign does not fit the model."""
    window, applied = _liveliest(view), tuple[Factor, ...]()
    at_start = changed(view, view.version.p, window).mismatch
    found = [*_exchanged(view, window), *look_crossed(view, window)]
    found = found or [*_turned(view, at_start)]
    found += [] if found else _ranges(view, fits=bool((at_start <= WRONG).all()))
    figures["mismatch"] = dict(zip(view.model.outputs.names, at_start.tolist(), strict=True))
    for _ in range(0 if {"exchanged", "turned"} & {one.kind for one in found} else 4):
        p = _numbers(view, partial(scaled, by=applied))
        seen = changed(view, p, scaled(window, applied))
        before = seen.mismatch
        if not (before > WRONG).any():
            break
        best = _best(view, p, (window, applied), seen)
        change = partial(scaled, by=applied)
        dynamic, sign = len(view.model.states) > 0, bool(best) and best[0].factor < 0
        if dynamic and not sign and (best or before.max() > MOST):
            left = best[0].after if best else before
            numbers = tuned(view, change, view.windows)  # not judged by those in doubt
            found += not_tuned(view, change(window), numbers, (before, left))
        if not best or (found and found[-1].kind == "not_tuned"):
            break
        found.append(_told(view, best, before))
        applied = (*applied, (best[0].suspect, best[0].factor))
    return found


def _exchanged(view: View, window: Block) -> Iterator[Finding]:
    """Columns that have changed places, of a model with states: they explain all that is off; or
    beams that run the other way round."""
    if view.setup.static:
        return
    best = likeliest(view.setup, view.model, view.version.p, [window])
    pose = pose_of(view.setup.spec, view.model)
    if best and pose and best[0].channels == (pose[2], pose[1]):
        yield Finding(
            "turned", pose[2], f"{', or '.join(one.said for one in best)}: so it fits the model",
            "[perception]", "turn the sign of start and step, if that is confirmed",
            {"hypotheses": [one.channels for one in best]},
        )  # fmt: skip
    if best and best[0].exchanged:
        yield Finding(
            "exchanged", best[0].channels[0],
            f"{', or '.join(one.said for one in best)}: so they fit the model",
            "[source.channels]",
            f"exchange the columns of {' and '.join(best[0].channels)}, if that is confirmed",
            {"hypotheses": [one.channels for one in best]},
        )  # fmt: skip


def _turned(view: View, missed: Vector) -> Iterator[Finding]:
    """An angle that is counted from elsewhere, which no number of the model takes up. ``missed``:
    mismatch of each output, (ny,)."""
    if not angles_of(view.model) or not (missed > ASKEW).any():
        return
    numbers = view.version.p, tuned(view, lambda window: window, view.windows)
    best = turned(view.setup, [Numbered(view.model, p) for p in numbers], view.windows)
    if best:
        scanned = rule_of(view.setup.spec, (best.channel,))
        yield Finding(
            "turned", best.channel,
            f"{best.said}: so {100 * best.share:.1f} % of the squared deviation is gone",
            "[perception]" if scanned else "[source.channels]", best.step(view.setup),
            best._asdict(),
        )  # fmt: skip


def _told(view: View, best: list[Hypothesis], before: Vector) -> Finding:
    first, outputs = best[0], view.model.outputs.names
    better = [k for k in range(len(outputs)) if first.after[k] < 0.9 * before[k]]
    shown = ", ".join(f"{outputs[k]} {before[k]:.2f} -> {first.after[k]:.2f}" for k in better)
    names = " or ".join(", ".join(one.suspect.names) for one in best)
    sign, place = first.factor < 0, "[[source]] time" if first.suspect.time else "[source.channels]"
    step = (
        f"scale = -1 for {names} in [source.channels], if its direction is confirmed"
        if sign
        else f"check the unit of {names} in {place}"
    )
    return Finding(
        "sign" if sign else "unit", first.suspect.names[0],
        f"{', or '.join(one.text for one in best)} fits the model: mismatch {shown}",
        place, step,
        {
            "before": before, "after": first.after,
            "hypotheses": [
                {"channels": one.suspect.names, "factor": one.said.split()[0]} for one in best
            ],
        },
    )  # fmt: skip


def _ranges(view: View, fits: bool) -> Iterator[Finding]:
    """Values that no machine has in the unit that is declared; ``fits``: does the model say them,
    too? Then a shaft turns as fast as it is said to."""
    spec, layouts = view.setup.spec, (view.model.inputs, view.model.outputs)
    joint = view.setup.static and any(one.unit == "rad" for layout in layouts for one in layout)
    turning = JOINT if joint else SHAFT
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
            elif channel.unit == "rad/s" and size > turning and not fits:
                hint = "degrees taken for radians (pi/180)? unit = 'deg/s'"
                if turning == SHAFT:
                    hint = "rpm taken for rad/s (pi/30)? unit = 'rpm'"
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
    most = ROWS // 4 if view.slow else ROWS
    best, size = view.windows[0], -1.0
    spread = np.nanstd(np.concatenate([w.u for w in view.windows]), axis=0) + 1e-300
    for window in view.windows:
        for start in range(0, len(window.t), most):
            piece = take(window, start, min(start + most, len(window.t)))
            if len(piece.t) < 2:
                continue
            moved = float(np.nansum(np.nanstd(piece.u, axis=0) / spread)) * math.sqrt(len(piece.t))
            if moved > size:
                best, size = piece, moved
    return best._replace(y=np.where(np.isfinite(best.y), best.y, np.nan))


def _numbers(
    view: View, change: Callable[[Block], Block] = lambda window: window
) -> ParameterVector:
    """The version's, or what the rows tune those of a static map to, once changed; held to resist,
    and in bounds, they take up no sign."""
    return view.version.p if len(view.model.states) else tuned(view, change)


def _best(
    view: View, p: ParameterVector, rows: tuple[Block, tuple[Factor, ...]], seen: Changes
) -> list[Hypothesis]:
    """What removes most, and what explains it as well; empty where nothing removes enough."""
    (window, applied), before = rows, seen.mismatch
    wrong, least = before > WRONG, ANSWERED * np.count_nonzero(seen.known)
    found = []
    for suspect in suspects(view.model.inputs, view.model.outputs, stamped_in(view.setup.spec)):
        if suspect.y and not wrong[list(suspect.y)].all():
            continue
        spec = view.setup.spec
        recorded = suspect.unit if suspect.time else unit_recorded(spec, suspect.names[0])
        for factor, said in suspect.factors(recorded):
            by = (*applied, (suspect, factor))
            q = _numbers(view, partial(scaled, by=by)) if factor < 0 else p
            there = changed(view, q, scaled(window, by))
            if np.count_nonzero(there.known) < least:
                continue  # the model has no answer to it: that explains nothing
            after = there.mismatch
            helped = (after < BETTER * before) & wrong
            if helped.any() and (after <= before + 0.1).all():
                found.append(Hypothesis(suspect, factor, said, after))
    # a channel that explains all by itself before the stamps, which every channel goes by
    alone = [one for one in found if not one.suspect.time and (one.after <= WRONG).all()]
    return [*_least(alone), *(one for one in _least(found) if one not in alone)][:3]


def _least(found: list[Hypothesis]) -> list[Hypothesis]:
    """What leaves least; the channel alone before a set of channels: they come in that order."""
    left = min((float(one.after.sum()) for one in found), default=0.0)
    return [one for one in found if float(one.after.sum()) <= 1.05 * left + 0.01]


def look_lags(view: View, figures: dict[str, Any]) -> Iterator[Finding]:
    """How late each output is after its prediction by a free run; or all of a pose by scans."""
    if both := late_scans(view.setup, view.model, view.version.p, view.windows):
        figures["late_scans"] = {"heading": both[0]._asdict(), "way": both[1]._asdict()}
        yield Finding(
            "lag", view.setup.spec.perception.pose[2] if view.setup.spec.perception else "",
            said_late(view.setup, both), "[[source]] offset",
            "measure which of the two it is, with one clock for all; a lag that is left in is "
            "learned as one of the drive", figures["late_scans"],
        )  # fmt: skip
        return
    window = max(view.judged, key=lambda one: len(one.t))
    window = take(window, 0, min(len(window.t), view.most))
    shared = _lag(view, window)
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


def _lag(view: View, window: Block) -> SharedLag:
    """How late it is: where numbers are tuned at each lag anew, until what is left is no row."""
    names = view.model.outputs.names
    known = np.zeros(len(names))
    shared = _lag_at(view, window, known, _numbers)
    if len(view.model.states):
        if not any(_matters(one, view.step) for one in shared.lags.values()):
            return shared
        shared = _lag_at(view, window, known, tuned)
    for _ in range(ROUNDS):
        more = np.array([_left(shared.lags.get(name), view.step) for name in names])
        if not more.any():
            break
        after = _lag_at(view, window, known + more, tuned)
        left = np.array([_left(after.lags.get(name), view.step) for name in names])
        if np.abs(left).max() > np.abs(more).max():
            break  # no lag that numbers had taken up a part of: it moves away
        shared, known = after, known + more
    if not known.any():
        return shared
    before = dict(zip(names, known.tolist(), strict=True))
    least = view.step / math.sqrt(12.0)  # of what may lie anywhere within half a row
    lags = {
        name: replace(one, seconds=one.seconds + before[name], sigma=max(one.sigma, least))
        for name, one in shared.lags.items()
    }
    # of several outputs with lags of their own there is no shared one
    whole = shared.seconds + before[names[0]] if len(set(before.values())) == 1 else math.nan
    return replace(shared, lags=lags, seconds=whole)


def _lag_at(view: View, window: Block, known: Vector, numbers: _Numbers) -> SharedLag:
    """How much later than ``known`` [s] per output."""
    model, earlier = view.model, partial(_earlier, seconds=known)
    p = numbers(view, earlier)
    x0 = model.initial(p)
    _, free = roll(kernel_of(model), x0, window.u, window.dt, p, restarts(window, math.inf, x0))
    return shared_lag(earlier(window), free, model.outputs, _longest(window))


def _left(found: Lag | None, step: float) -> float:
    return found.seconds if found is not None and _matters(found, step) else 0.0


def _earlier(window: Block, seconds: Vector) -> Block:
    """The window, its measurements moved to so much earlier."""
    if not seconds.any():
        return window
    t = (window.t - window.t[0]) * 1e-9
    y = np.full_like(window.y, np.nan)
    for j, s in enumerate(seconds):
        known = np.isfinite(window.y[:, j])  # of several sources, each measures at its own rows
        y[known, j] = np.interp(t[known] + s, t[known], window.y[known, j])
    return window._replace(y=y)


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
