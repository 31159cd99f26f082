"""Rows without what cannot be a measurement: for fits, which look at recordings without the loop.

The arbiter's plausibility (range, rate, codes for no value, frozen, off by a factor) speaks of the
sensor, so it holds for a fit too. Its gate speaks of the model, which is what a fit is about to
change: what lies outside the gate stays, unless it is far outside everything else in the channel.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from evertwin.fold import Block, Event, Mark
from evertwin.models import Model
from evertwin.setup.setup import Setup
from evertwin.types import Outputs, ParameterVector


class Span(NamedTuple):
    """Rows of an output that was told to be off by a factor.

    >>> Span(10, 20.0, 100.0).factor
    100.0
    """

    first: int
    stop: float
    factor: float


FAR = 100.0
"""Distance from the median, in widths of the middle 98 % of the channel, that is absurd."""


def screened(
    setup: Setup, model: Model, p: ParameterVector, windows: Iterable[Block]
) -> tuple[Block, ...]:
    """The windows, with outputs marked as errors that are none of the machine's doing."""
    track = setup.track(model)
    state, nu = track.renew(track.init(), p), len(model.inputs)
    out, events = list[Block](), list[Event]()
    for window in windows:
        state, seen = track.step(state, window)
        bad = (seen.rows.mark == Mark.ERROR) | _far(window.y)
        mark = np.concatenate([seen.rows.doubt, window.mark[:, nu:]], axis=1)
        mark[:, nu:] = np.where(bad, np.uint8(Mark.ERROR), mark[:, nu:])
        events += [one for one in seen.records if isinstance(one, Event)]
        out.append(window._replace(u=seen.rows.u, mark=mark))
    for k, name in enumerate(model.outputs.names):
        spans = () if len(model.states) else _factors(events, name)
        sound = [one for one in spans if not _is_off(out, k, one, spans)]
        for block in out if sound else ():
            wrong = _inside(block, sound) & ~_far(block.y)[:, k]
            block.mark[wrong & (block.mark[:, nu + k] == Mark.ERROR), nu + k] = Mark.OK
    return tuple(out)


def _factors(events: Sequence[Event], name: str) -> tuple[Span, ...]:
    """From where to where an output was told to be off by which factor."""
    found, since = list[Span](), dict[str, Span]()
    for event in events:
        if event.signal != name or event.evidence.get("cause", "factor") != "factor":
            continue
        if event.kind == "measurement_error":
            about: Any = event.evidence
            since[name] = Span(about["onset"], math.inf, abs(about["factor"]))
        elif event.kind == "measurement_restored" and name in since:
            found.append(since.pop(name)._replace(stop=event.row))
    return (*found, *since.values())


def _is_off(blocks: Sequence[Block], k: int, one: Span, spans: Sequence[Span]) -> bool:
    """Is the output another size in a span than outside of all, as by the factor? A version that
    lacks the friction is off by a hundred where little else is expected, on a sound sensor."""
    inside, other = (
        np.concatenate([_inside(block, some) for block in blocks]) for some in ([one], spans)
    )
    y = np.concatenate([block.y[:, k] for block in blocks])
    known = np.isfinite(y)
    here, there = (np.square(y[known & on]) for on in (inside, ~other))
    if not (here.any() and there.any()):
        return True
    size, factor = 0.5 * math.log(here.mean() / there.mean()), math.log(one.factor)
    return abs(size - factor) < abs(size)


def _inside(block: Block, spans: Sequence[Span]) -> np.ndarray:
    row = block.row + np.arange(len(block.t))
    return np.asarray(np.any([(one.first <= row) & (row <= one.stop) for one in spans], axis=0))


def _far(y: Outputs) -> np.ndarray:
    """Values far outside the rest of their channel, (n, ny)."""
    far = ~np.isfinite(y) & ~np.isnan(y)
    for k in range(y.shape[1]):
        known = y[np.isfinite(y[:, k]), k]
        if len(known) < 20:
            continue
        low, middle, high = np.quantile(known, [0.01, 0.5, 0.99])
        if high > low:
            with np.errstate(invalid="ignore", over="ignore"):
                far[:, k] |= np.abs(y[:, k] - middle) > FAR * (high - low)
    return np.asarray(far)
