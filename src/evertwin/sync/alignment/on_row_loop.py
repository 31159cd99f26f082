"""Compiled: what a channel is at a row, by the samples that wait, and where their memory has what.

A command is what it was over the row's interval, a measurement on the line to its next sample.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.sync.alignment.pace_loop import is_hole
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import HOT

SOURCE, COLUMN, HOW, TURNS, LOSES = range(5)
"""Settings per channel: source, its column, how it comes onto the row, is it an angle, may an empty
cell be a command that was lost (`evertwin.sync.alignment.lost_loop`)?"""
(
    HEAD, COUNT, NEWEST, OFFSET, QUIET, RUN, RUN_FIRST, RUN_LAST, RUN_COUNT, RUN_OTHERS, LATE,
    REPEATED, TIMELY, PACE, FRAMED, FRAME,
) = range(16)  # fmt: skip
"""Memory per source: ring, newest stamp, offset of its clock, is it silent?, the run of samples
that were not folded (kind, first and last stamp, number, timely samples at its start), counters,
its usual interval (where rows are cut at holes), the column that numbers the frame it is told in
(-1: none does), and the frame of the newest sample taken."""
OK, ABSENT, HELD, UNSEEN, ERROR = 0, 1, 2, 3, 6


@njit(**HOT)
def acted(channels: Any, state: Any, k: int, interval: Any) -> float:
    """Mean of command ``k`` over an interval that it may change within, as on a grid it does."""
    sources, times, values = state.sources, state.times, state.values
    s, depth, turns = channels[k, SOURCE], times.shape[1], channels[k, TURNS] > 0
    (begin, end), held = interval, state.known_v[k]
    total, value, since = 0.0, held, begin
    for m in range(sources[s, COUNT]):
        place = (sources[s, HEAD] + m) % depth
        if times[s, place] >= end:
            break
        new = values[s, place, channels[k, COLUMN]]
        if np.isfinite(new):
            total += wrapped(value - held, turns) * (times[s, place] - since)
            value, since = new, times[s, place]
    if since == begin:
        return float(held)
    total += wrapped(value - held, turns) * (end - since)
    return float(wrapped(held + total / (end - begin), turns))


@njit(cache=True, error_model="numpy")
def leaves_frame(sources: Any, values: Any, s: int, place: int) -> bool:
    """Is a sample that waits told in another frame than the newest one taken of its source?"""
    frame = values[s, place, sources[s, FRAMED]] if sources[s, FRAMED] >= 0 else np.nan
    return bool(frame == frame and int(frame) != sources[s, FRAME])


@njit(cache=True, error_model="numpy")
def take_frame(sources: Any, values: Any, s: int, place: int) -> None:
    """The frame of a sample that is taken."""
    if leaves_frame(sources, values, s, place):
        sources[s, FRAME] = int(values[s, place, sources[s, FRAMED]])


@njit(cache=True, error_model="numpy")
def borders(sources: Any, times: Any, values: Any, until: int) -> bool:
    """Does a source go on in another frame up to ``until``? No state is carried over there."""
    for s in range(sources.shape[0]):
        for m in range(sources[s, COUNT] if sources[s, FRAMED] >= 0 else 0):
            place = (sources[s, HEAD] + m) % times.shape[1]
            if times[s, place] > until:
                break
            if leaves_frame(sources, values, s, place):
                return True
    return False


@njit(cache=True, error_model="numpy")
def on_the_way(before: float, after: float, part: float, turns: bool) -> float:
    """The value a part of the way from one sample to the next; an angle goes the short way.

    One beyond a turn is recorded as it was, for it may be in another unit: there the short way is
    unknown, and where it jumps it is the nearer sample.
    """
    size = max(abs(before), abs(after))
    if not turns or size <= np.pi:
        return float(wrapped(before + wrapped(after - before, turns) * part, turns))
    if size <= 2 * np.pi:
        return float(before + wrapped(after - before, turns) * part)
    if abs(after - before) > 2 * np.pi:
        return float(after if part > 0.5 else before)
    return float(before + (after - before) * part)


@njit(**HOT)
def between(channels: Any, state: Any, k: int, stamp: int, gap: int) -> Any:
    """(channel ``k`` on the line to its next finite sample that waits, its mark); NaN without."""
    sources, times, values = state.sources, state.times, state.values
    known_t, known_v = state.known_t, state.known_v
    s, depth = channels[k, SOURCE], times.shape[1]
    for m in range(sources[s, COUNT]):
        place = (sources[s, HEAD] + m) % depth
        value = values[s, place, channels[k, COLUMN]]
        if np.isfinite(value):
            width = times[s, place] - known_t[k]
            if width > gap or leaves_frame(sources, values, s, place):
                return np.nan, ABSENT
            part = (stamp - known_t[k]) / width
            level = UNSEEN if is_hole(sources[s, PACE], width) else HELD
            return on_the_way(known_v[k], value, part, channels[k, TURNS] > 0), level
    return np.nan, ABSENT
