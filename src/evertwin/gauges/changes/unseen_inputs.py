"""Is the deviation where the inputs had never been? Then it is of the form, as far as anyone knows.

A form that holds where it was judged need not hold elsewhere. Where the rows that deviate have
inputs outside the range of all rows before that the version ran on, and those inside it are as near
to the version as they were, no sensor is accused and no number is learned: numbers that suit the
new rows would be worse where it held. With no row inside the range nobody can tell a form from a
machine that changed.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.gauge_rows import LEAST, Rows
from evertwin.gauges.rows.sensor_change import SensorChange, unmeasured
from evertwin.rows.ring import called
from evertwin.types import Bool, Bools, Float64, Inputs, Vector

Seen: TypeAlias = Float64[np.ndarray, "2 nu"]

RARE = 0.01
"""Share of the rows before that lie beyond either end of what counts as their range."""
ROOM = 0.1
"""Share of a range by which an input may leave it."""
PLACES = 100
"""Rows, evenly spread, from which on the machine, or the range, may have been another."""
CLEAR = 4.0
"""Logarithm of the likelihood ratio from which on rows are off otherwise than the others."""
SOON = 0.2
"""Share of the first rows that are outside of an input that left its range at once."""
HALF = 0.5
"""Part of the share that is outside later on that is so soon, too, at least."""
LEAPS = 3.0
"""So many times its largest step before an input leaps."""
AS_WELL = 0.6
"""Part of what a change of the machine explains that the range has to explain."""
NEARLY = 0.98
"""Part of the largest from which on a later row does as well."""
PART = 0.3
"""Part of what rows outside are off by more than usual that rows inside may be."""
USUAL = 3.0
"""So many times their usual square rows inside are off at most."""
NAMED = 3
"""Inputs that are named."""
OUTSIDE = "outside what it has seen"
"""How that is told."""


@unmeasured()
def elsewhere(rows: Rows) -> SensorChange | None:
    """That rows which deviate are outside what the version was judged on; None: they are not."""
    setup, nu = rows.setup, len(rows.setup.model.inputs)
    past = np.concatenate([np.zeros((0, nu)), *(one.u for one in rows.earlier)])
    u, known = rows.values[:, :nu], np.isfinite(rows.before).any(axis=1)
    squares, places = rows.squares(rows.before), np.arange(rows.count)
    by_time, by_range = (0.0, 0), list[tuple[float, int]]()
    for place in np.unique(np.linspace(0, rows.count - LEAST, PLACES).astype(int)).tolist():
        by_time = max(by_time, (_gain(squares[known], (places >= place)[known]), place))
        if nu and len(past) + place >= setup.enough:
            out = np.asarray(_out(u, past, place, rows.seen).any(axis=1))
            by_range.append((_gain(squares[known], out[known]), place))
    most = max((gain for gain, _ in by_range), default=0.0)
    if most < max(CLEAR, AS_WELL * by_time[0]):
        return None
    first = max(place for gain, place in by_range if gain >= NEARLY * most)
    out = _out(u, past, first, rows.seen)
    some = np.asarray(out.any(axis=1))
    for place in (first, by_time[1]):  # whichever was the earlier, rows inside have to be as usual
        since = places >= place
        inside = known & ~(since | some)
        if not (_only_there(squares[known], since[known], some[known]) and _held(rows, inside)):
            return None
    return SensorChange("", 1.0, (
        f"{OUTSIDE} before {called(rows.row(first))}: "
        f"{_told(rows, np.concatenate([past, u[:first]]), u[first:], out[first:])}: whether "
        "the form does not hold there or the machine changed cannot be told from these rows; "
        "nothing is learned from them, and no sensor is blamed"
    ))  # fmt: skip


def _held(rows: Rows, usual: Bools) -> bool:
    """Was the version within what is asked on these rows? Else its range is not what is wrong."""
    setup, off = rows.setup, rows.before[usual]
    if len(off) < LEAST or not np.isfinite(setup.requirement):
        return True
    limit = setup.requirement * setup.sizes(rows.values[:, len(setup.model.inputs) :])
    return not (np.sqrt(np.nanmean(np.square(off), axis=0)) > limit)[setup.watched].any()


def _told(
    rows: Rows, old: Inputs, new: Float64[np.ndarray, "since nu"], out: Bool[np.ndarray, "since nu"]
) -> str:
    """Inputs that are out of the range of those before, the farthest first."""
    setup, (low, high) = rows.setup, _range(old, rows.seen)
    far = np.nansum(np.where(out, np.fmax(low - new, new - high) / (high - low), 0.0), axis=0)
    told = []
    for k in np.argsort(-far)[:NAMED].tolist():
        if not far[k] > 0.0:
            break
        channel = setup.model.inputs.channels[k]
        above = np.count_nonzero(new[:, k] > high[k]) >= np.count_nonzero(new[:, k] < low[k])
        extreme = np.nanmax if above else np.nanmin
        before = old[:, k] if rows.seen is None else np.append(old[:, k], rows.seen[int(above), k])
        most, now, often = float(extreme(before)), float(extreme(new[:, k])), "never"
        if (most >= now) if above else (most <= now):  # on so few rows that they do not count
            often, share = "hardly ever", 1.0 - RARE if above else RARE
            most = float(np.nanquantile(old[:, k], share))
        bounds = (in_words.level(setup, channel, one) for one in (most, now))
        told.append("{} was {} {} {}, and is now at {}".format(
            channel.name, often, "above" if above else "below", *bounds))  # fmt: skip
    return ", ".join(told)


def _range(old: Inputs, seen: Seen | None) -> tuple[Vector, Vector]:
    """Lowest and highest value of each input that counts as seen, (nu,): of ``old`` rows, and of
    those that are kept no longer."""
    low, high = np.nanquantile(old, (RARE, 1.0 - RARE), axis=0)
    if seen is not None:
        low, high = np.fmin(low, seen[0]), np.fmax(high, seen[1])
    room = ROOM * (high - low) + 1e-9 * np.maximum(np.abs(low), np.abs(high)) + 1e-12
    return low - room, high + room


def _out(
    u: Inputs, past: Float64[np.ndarray, "past nu"], place: int, seen: Seen | None
) -> Bool[np.ndarray, "n nu"]:
    """Which values from a row on lie outside the range of those before, of inputs that left it, or
    leapt, about there: one that strays by and by, as weather does, explains nothing that begins at
    once."""
    low, high = _range(np.concatenate([past, u[:place]]), seen)
    out = (u < low) | (u > high)
    out[:place] = False
    wide = LEAST + len(u) // PLACES
    later = out[place:].mean(axis=0)
    soon = out[place : place + wide].mean(axis=0) >= np.maximum(SOON, HALF * later)
    steps = np.nan_to_num(np.abs(np.diff(u, axis=0)))
    if place > 2 * wide:
        usual, near = steps[: place - wide], steps[place - wide : place + wide]
        soon |= near.max(axis=0) > LEAPS * np.maximum(usual.max(axis=0), 1e-300)
    return np.asarray(out & soon)


def _gain(squares: Vector, off: Bools) -> float:
    """Logarithm of how much likelier two sizes are than one, rows that are ``off`` the larger."""
    n, m = len(squares), int(np.count_nonzero(off))
    if m < LEAST or n - m < LEAST:
        return 0.0
    there, rest = float(np.mean(squares[off])), float(np.mean(squares[~off]))
    if not there > rest > 0.0:
        return 0.0
    whole = n * np.log(np.mean(squares))
    return float(0.5 * (whole - m * np.log(there) - (n - m) * np.log(rest)))


def _only_there(squares: Vector, since: Bools, out: Bools) -> bool:
    """Are rows ``since`` some row off where they are ``out``, and not where they are not?"""
    usual, here = squares[~(since | out)], squares[since & ~out]
    if len(here) < LEAST or not len(usual):
        return True
    size = float(np.mean(usual))
    inside, outside = float(np.mean(here)), float(np.mean(squares[out]))
    return inside <= USUAL * size and inside - size <= PART * (outside - size)
