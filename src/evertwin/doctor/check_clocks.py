"""Do the sources' clocks agree? Offset, drift and the transport lag that all outputs share.

Two sources show the same motion twice: as the model predicts it from the one, and as the other
measures it. The prediction starts anew from the measurement every few seconds, and its steps are
added up, so that what the model gets wrong over a long drive does not count. Lags of consecutive
pieces give the offset between the clocks and its growth (`evertwin.signals.delay.clock_offset`);
the lags of all outputs of one source, weighed together, say whether it is one delay
(`evertwin.sync.shared_lag`). A constant offset and a transport lag look the same; a growing one
is a clock's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evertwin.doctor.check_units import stated
from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.errors import DataError
from evertwin.fold import Block, plain, take
from evertwin.models import roll
from evertwin.models.functions.function import kernel_of
from evertwin.rows.channels import recorded_as
from evertwin.signals import Layout, unwrapped, wrap
from evertwin.signals.delay import Offset, clock_offset
from evertwin.signals.related import follows
from evertwin.sync.horizon.horizon import restarts, trusted
from evertwin.sync.horizon.lag import SharedLag, shared_lag
from evertwin.types import Outputs, Vector

PIECE = 10.0
"""The prediction starts anew after this long [s], or five horizons if that is more."""
LONGEST = 0.5
"""Offsets up to this are looked for [s], or 20 rows if that is more."""


@dataclass(frozen=True)
class Clocks:
    """What is known of one source's clock against that of the inputs.

    >>> Clocks("camera", "base", SharedLag(0.1, 0.01, True, "", {}), None, "").source
    'camera'
    """

    source: str
    against: str
    """The source of the inputs."""
    lag: SharedLag
    """One lag of all outputs of the source, and that of each."""
    offset: Offset | None
    """Offset and drift, from the output that shows them best; None where no piece shows any."""
    output: str
    """That output."""

    def __str__(self) -> str:
        found, head = self.offset, f"{self.source} against {self.against}"
        if found is None:
            return f"{head}: no offset can be told: {self.lag.reason}"
        return (
            f"{head}: later by {1e3 * found.seconds:.0f} ± {1960 * found.sigma:.0f} ms (from "
            f"{self.output}, correlation {_correlation(found):.2f}), growing by "
            f"{1e6 * found.drift:.0f} ± {1.96e6 * found.drift_sigma:.0f} µs a second; "
            f"{self.lag.reason}"
        )


def look_clocks(view: View, figures: dict[str, Any]) -> Iterator[Finding]:
    """Sources whose clocks differ; figures of all of them."""
    pairs = list(_pairs(view))
    if not pairs:
        return
    window = max(view.judged, key=lambda one: len(one.t))
    window = take(window, 0, min(len(window.t), 10 * view.most))
    predicted, told = _predicted(view, window), {}
    for source, against, columns in pairs:
        found = _compared(view, window, predicted, columns, view.step)
        found = replace(found, source=source, against=against)
        strangers = _strangers(found, window, predicted, view.model.outputs, columns)
        yield from strangers or _differs(found, window, view.step)
        if not strangers:
            told[source] = found
    figures["clocks"] = {name: _plain(one) for name, one in told.items()}


def _pairs(view: View) -> Iterator[tuple[str, str, list[int]]]:
    """Each source that measures outputs, the source of the inputs, and which outputs."""
    spec, model = view.setup.spec, view.model
    home = {name: source.name for source in spec.source for name in source.channels}
    behind = {home.get(recorded_as(spec, name), "") for name in model.inputs.names}
    if len(spec.source) < 2 or len(behind) != 1:
        return
    (against,) = behind
    columns: dict[str, list[int]] = {}
    for k, name in enumerate(model.outputs.names):
        columns.setdefault(home.get(recorded_as(spec, name), ""), []).append(k)
    for source, which in columns.items():
        if source and against and source != against:
            yield source, against, which


def _predicted(view: View, window: Block) -> Outputs:
    """Predicted outputs, each start laid on what was predicted before it, (n, ny)."""
    model, p = view.model, view.version.p
    kernel = kernel_of(model)
    x0 = model.initial(p)
    plan = restarts(window, max(PIECE, 5 * view.horizon) if len(x0) else math.inf, x0)
    _, y = roll(kernel, x0, window.u, window.dt, p, plan)
    if not len(x0):
        return y
    start = np.where(np.isnan(plan.y), y, plan.y)
    steps = np.zeros_like(y)
    steps[1:] = wrap(y[1:] - start[:-1], model.outputs.angles)
    return np.asarray(np.cumsum(np.where(np.isfinite(steps), steps, 0.0), axis=0))


def _compared(view: View, window: Block, y: Outputs, which: list[int], step: float) -> Clocks:
    """Shared lag, offset and the output that shows it; names are filled in by the caller."""
    outputs, nu = view.model.outputs, window.u.shape[1]
    mark = np.concatenate([window.mark[:, :nu], window.mark[:, [nu + k for k in which]]], axis=1)
    some = window._replace(y=np.ascontiguousarray(window.y[:, which]), mark=mark)
    layout = Layout(tuple(outputs.channels[k] for k in which))
    longest = min(max(LONGEST, 20 * step), view.seconds / 10)
    lag = shared_lag(some, y[:, which], layout, longest)
    sure = [name for name, one in lag.lags.items() if one.verdict == "identified"]
    if not sure:
        return Clocks("", "", lag, None, "")
    best = min(sure, key=lambda name: lag.lags[name].sigma)
    k = layout.names.index(best)
    pair = [y[:, which[k]], trusted(some)[:, k]]
    try:
        return Clocks("", "", lag, _offset(window, pair, bool(layout.angles[k]), longest), best)
    except DataError:
        return Clocks("", "", lag, None, best)


def _offset(window: Block, pair: list[Vector], angle: bool, longest: float) -> Offset:
    known = [np.isfinite(side) for side in pair]
    values = [side[there] for side, there in zip(pair, known, strict=True)]
    if angle:
        values = [np.unwrap(side) for side in values]
    stamps = [window.t[there] for there in known]
    return clock_offset(stamps[0], values[0], stamps[1], values[1], longest)


def _strangers(
    clocks: Clocks, window: Block, y: Outputs, outputs: Layout, which: list[int]
) -> list[Finding]:
    """The finding that a source's outputs follow the inputs at no lag: they are another machine's.

    One output that follows is enough; so is chance, where nobody would see it.
    """
    t, measured = 1e-9 * (window.t - window.t[0]), trusted(window)
    told, longest = {}, float(t[-1]) / 4
    for k in which:
        level = unwrapped(measured[:, k]) if outputs.angles[k] else measured[:, k]
        rate = np.append(np.diff(y[:, k]) / np.diff(t), 0.0)
        told[outputs.names[k]] = follows(t, rate, t, level, longest)
    unlike = {name: one for name, one in told.items() if one.unrelated}
    if not unlike or any(one.clear for one in told.values()):
        return []
    name = min(unlike, key=lambda one: unlike[one].chance)
    return [Finding(
        "unrelated", clocks.source,
        f"{name} of {clocks.source} follows nothing that {clocks.against} says, at any lag up to "
        f"{longest:.3g} s (correlation {unlike[name].correlation:.2f}, by chance up to "
        f"{unlike[name].chance:.2f})",
        f"[[source]] {clocks.source}",
        f"take {clocks.against} and {clocks.source} from one machine: its namespace, or its files",
        {"correlation": unlike[name].correlation, "chance": unlike[name].chance},
    )]  # fmt: skip


def _differs(clocks: Clocks, window: Block, step: float) -> Iterator[Finding]:
    """The finding, where an offset is sure and matters."""
    found = clocks.offset
    if found is None:
        return
    late = abs(found.seconds) > max(4 * found.sigma, 0.5 * step)
    grown = abs(found.drift) > 4 * found.drift_sigma
    if late or grown:
        yield Finding(
            "clock", clocks.source, str(clocks),
            f"rows {window.row} to {window.row + len(window.t) - 1}", _step(clocks, found, grown),
            {"seconds": found.seconds, "sigma": found.sigma, "drift": found.drift},
        )  # fmt: skip


def _step(clocks: Clocks, found: Offset, grown: bool) -> str:
    if grown:
        return (
            "the clocks run apart: set them by one server, or cut the recording and give each part "
            "its [[source]] offset"
        )
    if clocks.lag.agree:
        return (
            f"if it is a clock's, give [[source]] {clocks.source} offset = "
            f"'{-found.seconds:.3f} s'; if it is a transport lag, allow 'lag' in [correction] terms"
        )
    least = min(one.seconds for one in clocks.lag.lags.values() if one.verdict == "identified")
    return (
        f"the outputs' lags differ, so {least:.3g} s at most are the clock's or a shared transport "
        "lag, the rest is the machine's: allow 'lag' in [correction] terms"
    )


def _correlation(found: Offset) -> float:
    return max(one.correlation for one in found.pieces)


def _plain(clocks: Clocks) -> dict[str, Any]:
    """The figures of one source."""
    lag, found = clocks.lag, clocks.offset
    out: dict[str, Any] = {
        "against": clocks.against, "said": str(clocks),
        "shared_lag": stated(lag),
        "lags": plain(lag.lags),
        "offset": None,
    }  # fmt: skip
    if found is not None:
        reach = 1.96 * found.sigma
        out["offset"] = {
            "seconds": found.seconds,
            "interval95": (found.seconds - reach, found.seconds + reach),
            "drift": found.drift, "drift_sigma": found.drift_sigma, "output": clocks.output,
            "correlation": _correlation(found), "pieces": len(found.pieces),
        }  # fmt: skip
    return out
