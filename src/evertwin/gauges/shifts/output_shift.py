"""Is it what a sensor adds to an output, or multiplies it by, or is the machine another one?

Either is told by numbers that go with time: what the sensor is off by, or the parameters of the
machine. Over parts of the rows both may go in straight lines; the machine may also leap from part
to part, and has all its parameters. So where one number of one sensor leaves as little as before,
and far less than any machine or input, it is the sensor. Where both leave about as little (one
output of a machine that one parameter makes as much larger), or the sensor leaves no more than was
usual before, nobody can tell; the machine is learned, and it is said what would look the same. A
machine that leaps from part to part comes near a share that stays the same, too; such a share is
compared with one machine for all rows, in what each leaves beyond the usual.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from evertwin.gauges.changes.change import split
from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.gauge_rows import LEAST, Rows, residual
from evertwin.gauges.rows.sensor_change import SensorChange, unmeasured
from evertwin.gauges.shifts.off_by import Column, learned, recorded, undone
from evertwin.ledger.caveats import SAME, SENSOR
from evertwin.models.kernels.kernel import CONTINUE
from evertwin.rows.ring import called
from evertwin.signals.spoken import MANY, share
from evertwin.types import Bool, Bools, Float64, Outputs, Vector

PARTS = 6
"""Parts of the rows, at most."""
ROWS = 60
"""Rows of a part, at least."""
PREDICTIONS = 4
"""Predictions of a part, at least."""
EXPLAINED = 0.5
"""Share of the squared deviation that a sensor leaves at most."""
OF_NOTE = 0.25
"""Part of the squared deviation that what a sensor is off by has to make, on its own output."""
RESTORED = 2.0
"""So many times the usual mean square it leaves at most."""
NORMAL = 2.2
"""Mean square of normal residuals of which half are below 1: what is usual where nobody saw it."""
CLEARLY = 2.0
"""So many times what a sensor leaves the machine has to leave for the sensor to be named."""
ALIKE = 1.5
"""So many times what the machine leaves a sensor may leave to look the same."""
ALONE = "no machine, nor an input, explains as much; nothing is learned from it"
AGAIN = (
    "a machine has to become another one time and again for that: sensor or machine, that cannot "
    "be told from these rows; nothing is learned until it can"
)
BARELY = 0.7
"""Part of the squared deviation that one machine for all rows leaves where it explains nothing."""


class Off(NamedTuple):
    """What a channel is off by.

    >>> Off(0, True, np.array([0.0, 0.25]), np.zeros((2, 1)), np.zeros((2, 1))).by.tolist()
    [0.0, 0.25]
    """

    column: int
    """Of inputs, then outputs."""
    scaled: bool
    """Is it a share of what is read?"""
    by: Vector
    """At each row, in SI or as a share, (n,)."""
    left: Outputs
    """Residual without it, (n, ny)."""
    alone: Outputs
    """The same where the machine stays as it was, (n, ny)."""


@unmeasured()
def shifted_output(rows: Rows) -> tuple[SensorChange | None, str]:
    """The output whose sensor explains the rows as no machine does; or what is said of one that
    explains them as well.

    Args:
        rows: before the deviation and since then, tuned.
    """
    edges = _edges(rows)
    outputs = _off_outputs(rows, edges)
    if rows.fitted >= LEAST and not _explains(rows, edges[0], outputs):
        return None, ""  # what an input may be off by, or the machine, need not be known
    machine = _machine(rows, edges) if outputs else None
    if rows.fitted < LEAST and machine is not None:  # what is usual is what anybody leaves at least
        lefts = [machine, *(one.left for one in outputs)]
        size = np.nanmin([np.nanmedian(np.abs(left), axis=0) for left in lefts], axis=0)
        rows = replace(rows, given=np.where(size > 0.0, size, rows.sizes))
        outputs, machine = _off_outputs(rows, edges), _machine(rows, edges)
    if machine is None:
        return None, ""
    known = np.isfinite(machine) & np.isfinite(rows.before)
    for one in outputs:
        known &= np.isfinite(one.left)
    count = np.count_nonzero(known.any(axis=1))
    enough, nu = count >= LEAST, len(rows.setup.model.inputs)
    off = rows.total(rows.before, known)
    outputs = [one for one in outputs if _of_note(rows, one, known, off)]
    if not outputs:
        return None, ""
    best = min(outputs, key=lambda one: rows.total(one.left, known))
    ours, theirs = (rows.total(r, known) for r in (best.left, machine))
    if not count or ours > EXPLAINED * off:
        return None, ""
    early = rows.squares(rows.before)[: rows.fitted]
    seen = len(early) >= LEAST
    usual = count * float(np.mean(early)) if seen else NORMAL * np.count_nonzero(known)

    @cache
    def least() -> float:
        """What an input that is off leaves at least; asked of what is clear without it alone."""
        return _of_inputs(rows, edges, known)

    clear = (not seen or ours <= RESTORED * usual) and theirs >= CLEARLY * ours
    clear = clear and least() >= CLEARLY * ours
    steady = None if clear or not best.scaled else _steady(rows, best, edges[0], known)
    if steady is not None:
        left = rows.total(steady.left, known)
        above = usual + CLEARLY * max(left - usual, 0.0)
        good = left <= RESTORED * usual and rows.total(rows.tuned, known) >= above
        if good and least() >= above:
            best, ours, clear = steady, left, True
    channel, said = rows.setup.model.outputs.channels[best.column - nu], _said(rows, best, edges[0])
    alike = ours <= ALIKE * theirs or (seen and ours <= usual)  # the usual is nothing to explain
    # of a machine that became another one as well nobody says that its sensor alone did
    alike = alike and rows.total(best.alone, known) <= ALIKE * max(theirs, usual * _larger(best))
    again = alike and rows.total(rows.tuned, known) >= BARELY * off
    if enough and (clear or again):
        part = 100 * (1.0 - ours / off)
        why = f"as its sensor's this explains {part:.0f} % of the deviation, and "
        why = f"{channel.name} looks off by {said}: {why}{ALONE if clear else AGAIN}"
        return SensorChange(channel.name, 1.0, why, None, rows.row(edges[0])), ""
    told = alike or (steady is not None and _as_learned(rows, steady, known))
    return None, f"; {SENSOR}{channel.name} that is off by {said} {SAME}" if told else ""


def _larger(one: Off) -> float:
    """So many times its usual square a version is off where its sensor reads more, as it was."""
    on = one.by[one.by != 0.0]
    return max(float(np.mean(np.square(1.0 + on))), 1.0) if one.scaled and len(on) else 1.0


def _as_learned(rows: Rows, one: Off, known: Bool[np.ndarray, "n ny"]) -> bool:
    """Does one share leave as little as what is learned, which is one machine, too? The machine
    as it was, that is: asked where no prediction begins with what the rows before tell of it."""
    known = known & rows.scored(rows.fitted + 1)[:, None]
    enough = int(np.count_nonzero(known)) >= LEAST
    return enough and rows.total(one.alone, known) <= ALIKE * rows.total(rows.tuned, known)


def _steady(rows: Rows, one: Off, first: int, known: Bool[np.ndarray, "n ny"]) -> Off | None:
    """The same channel off by one share from row ``first`` on, as predictions tell that begin
    there; None: that, or one machine for all rows, has no residual on some of the ``known``."""
    since = (np.arange(rows.count) >= first)[:, None] * 1.0
    found = _off(rows, (one.column, True), since, rows.scored(first + 1))
    told = found is not None and np.isfinite(found.left[known] + rows.tuned[known]).all()
    return found if told else None


def moves(rows: Rows, one: Off, known: Bool[np.ndarray, "n ny"]) -> float:
    """What a sensor is off by, in squares of its residual: one that is not off explains nothing,
    however well the machine that was tuned beside it fits."""
    k = one.column - len(rows.setup.model.inputs)
    read = rows.values[:, one.column] - rows.zeros[one.column]
    by = one.by * read / (1.0 + one.by) if one.scaled else one.by
    return float(np.square(by[known[:, k]] / rows.sizes[k]).sum())


def _of_note(rows: Rows, one: Off, known: Bool[np.ndarray, "n ny"], off: float) -> bool:
    """Is it what a sensor is off by that explains, rather than what was tuned beside it? What
    swings is off by more than its sensor, which alone explains it then."""
    alone = rows.total(one.alone, known)
    return moves(rows, one, known) >= OF_NOTE * off or alone <= EXPLAINED * off


def _off_outputs(rows: Rows, edges: list[int]) -> list[Off]:
    """What each output may be off by, or by what share."""
    nu, ny = len(rows.setup.model.inputs), len(rows.setup.model.outputs)
    lengths = np.flatnonzero(~rows.setup.model.outputs.angles)  # of a turn a share is nothing
    tried = [(nu + k, False) for k in range(ny)] + [(nu + k, True) for k in lengths.tolist()]
    lines = _lines(rows.count, edges)
    return [one for k in tried for one in (_off(rows, k, lines),) if one is not None]


def _explains(rows: Rows, first: int, found: list[Off]) -> bool:
    """Is there one that is off, and explains the rows since ``first``?"""
    known = np.isfinite(rows.before) & (np.arange(rows.count) >= first)[:, None]
    for one in found:
        known &= np.isfinite(one.left)
    off = rows.total(rows.before, known)
    return any(
        _of_note(rows, one, known, off) and rows.total(one.left, known) <= EXPLAINED * off
        for one in found
    )


def _of_inputs(rows: Rows, edges: list[int], known: Bool[np.ndarray, "n ny"]) -> float:
    """What is left at least where an input is off, in squares; where it has no answer, all is."""
    lines, inputs = _lines(rows.count, edges), range(len(rows.setup.model.inputs))
    found = [one.left for k in inputs for one in (_off(rows, (k, False), lines),) if one]
    lefts = [np.where(np.isfinite(left), left, rows.before) for left in found]
    return min((rows.total(left, known) for left in lefts), default=math.inf)


def _said(rows: Rows, one: Off, first: int) -> str:
    channel = rows.setup.model.outputs.channels[one.column - len(rows.setup.model.inputs)]
    last = float(one.by[-1])
    size = in_words.difference(rows.setup, channel, last)
    if one.scaled:
        size = f"{100 * last:+.3g} %" if abs(last) < MANY else share(last)
    since = f" (since {called(rows.row(first))})" if first else ""
    return f"{size} at {called(rows.row(rows.count - 1))}{since}"


def _edges(rows: Rows) -> list[int]:
    """Positions at which parts begin, and the end."""
    first, count = rows.fitted, rows.count - rows.fitted
    begins = np.count_nonzero(rows.whole.restart.code[first:] != CONTINUE)
    states = len(rows.setup.model.states)
    parts = min(PARTS, count // ROWS, begins // PREDICTIONS if states else PARTS)
    return [round(edge) for edge in np.linspace(first, rows.count, max(parts, 1) + 1).tolist()]


def _lines(n: int, edges: list[int]) -> Float64[np.ndarray, "n k"]:
    """Broken lines over the parts, one for each edge; zero before, (n, edges)."""
    at = np.arange(n)
    each = np.stack([np.interp(at, edges, row) for row in np.eye(len(edges))], axis=1)
    each[: edges[0]] = 0.0
    return each


def _off(
    rows: Rows, one: Column, lines: Float64[np.ndarray, "n k"], seen: Bools | None = None
) -> Off | None:
    """What a channel has to be off by, or by what share, to leave least of rows that are ``seen``,
    (n,), beside one machine tuned to all rows; a sum of ``lines``."""
    found = learned(rows, one, lines, seen)
    if found is None:
        return None
    by, left, columns = found
    alone, tuned = left, rows.left_on(undone(rows.setup, rows.windows, one, by))
    if tuned is not None:
        tuned = recorded(rows.setup, tuned, one, by)
        more = rows.least(columns, tuned, seen)
        tuned = tuned + columns @ more
        known = np.isfinite(tuned) & np.isfinite(left)
        if rows.total(tuned, known) < rows.total(left, known):
            by, left = by + lines @ more, tuned
    return Off(*one, by, left, alone)


def _machine(rows: Rows, edges: list[int]) -> Outputs | None:
    """Residual of the machine, tuned anew to each part, its numbers in straight lines, (n, ny);
    None: a part tells no machine. A state that nothing measures does not begin anew with a part:
    where numbers that go in broken lines over all rows leave less, it is these."""
    out, whole = np.full(rows.before.shape, np.nan), rows.growing(_lines(rows.count, edges))
    for a, b in pairwise(edges):
        part = split(split(rows.windows, b)[0], a)[1]
        fit = rows.tuned_on(part)
        if fit is None:
            return None
        posed = rows.pose(part).tuning(fit.names)
        left, pull = residual(posed, fit.values), -posed.jacobian(fit.values)
        grown = np.linspace(-1.0, 1.0, b - a)[:, None, None]
        columns = np.concatenate([pull, pull * grown], axis=2)
        out[a:b] = left + columns @ rows.least(columns, left)
        both = np.isfinite(out) & np.isfinite(whole) & _within(rows, a, b)[:, None]
        if rows.total(whole, both) < rows.total(out, both):
            out[a:b] = whole[a:b]
    return out


def _within(rows: Rows, a: int, b: int) -> Bools:
    at = np.arange(rows.count)
    return np.asarray((a <= at) & (at < b))
