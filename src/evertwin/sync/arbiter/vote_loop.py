"""Compiled: the vote of contested samples, and the notes that become records.

See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.sync import places as at
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Cause, Finding
from evertwin.sync.workspace import Case

ERROR, OVERRULED, RESTORED = int(Finding.ERROR), int(Finding.OVERRULED), int(Finding.RESTORED)
VOTE, END, FACTOR = int(Cause.VOTE), int(Cause.END), int(Cause.FACTOR)
ONWARD = 0.1
"""Part of its leap by which an output moves on until the next sample."""
LOUD = 1.5**2
"""Test ratio from which on contested samples are told of: of Gaussian noise beyond four deviations
every ten-thousandth sample is, beyond six none."""


@njit(**COLD)
def note(case: Case, now: Any, kind: int, g: int, cause: int, span: Any) -> None:
    """Notes a finding at ``now`` (row, stamp) about ``span`` (first, last row, samples)."""
    (found, detail, extent), (values, _, figures) = case.notes, case.memory
    k = extent[0]
    extent[0] = k + 1
    found[k, at.ROW], found[k, at.STAMP] = now
    found[k, at.KIND], found[k, at.GROUP], found[k, at.WHY] = kind, g, cause
    found[k, at.FIRST], found[k, at.FINAL], found[k, at.NUMBER] = span
    ny = values.shape[0]
    detail[k, 0] = figures[g, at.FACTOR]
    told = at.WRONG if kind in (ERROR, RESTORED) else at.NU
    for j in range(ny):
        detail[k, 1 + j], detail[k, 1 + ny + j] = values[j, told], values[j, at.BASE]


@njit(**COLD)
def remember(case: Case, g: int, size: int, now: Any) -> None:
    """A contested sample takes part in the vote; the oldest leaves it."""
    (values, numbers, _), room, (row, stamp) = case.memory, case.sample[0], now
    ring, paths, times, rows, expected = case.board
    last = int(case.settings[1][g, at.VOTE]) - 1
    numbers[g, at.LEFT] = rows[0, g]
    for i in range(last):
        times[i, g], rows[i, g] = times[i + 1, g], rows[i + 1, g]
        for k in range(size):
            j = room[k]
            ring[i, j], paths[i, j] = ring[i + 1, j], paths[i + 1, j]
            expected[i, j] = expected[i + 1, j]
    times[last, g], rows[last, g] = stamp, row
    for k in range(size):
        j = room[k]
        ring[last, j], paths[last, j] = values[j, at.NU], values[j, at.PATH]
        expected[last, j] = values[j, at.LAST] - values[j, at.NU]
    numbers[g, at.CONTEST] += 1
    numbers[g, at.CONTESTED] += 1
    if numbers[g, at.BATCH] == 0:
        numbers[g, at.BATCH_ROW] = row
    numbers[g, at.BATCH] += 1


@njit(**COLD)
def agrees(case: Case, g: int, size: int) -> bool:
    """Do the last k contested samples lie on one line beside the prediction?

    A machine that was moved is off by a constant; one that moves otherwise than predicted, by a
    line. The scatter about it must stay within the gate, and its slope must be credible.
    """
    (limits, rules, _), values, room = case.settings, case.memory[0], case.sample[0]
    ring, paths, times, _, _ = case.board
    votes = int(rules[g, at.VOTE])
    newest = times[votes - 1, g]
    span = (newest - times[0, g]) * 1e-9
    for k in range(size):
        j = room[k]
        gate = rules[g, at.GATE] * np.sqrt(values[j, at.BASE])
        angle = limits[j, at.ANGLE] > 0
        s0, s1, s2, r0, r1 = float(votes), 0.0, 0.0, 0.0, 0.0
        for i in range(votes):
            a = (times[i, g] - newest) * 1e-9
            d = wrapped(ring[i, j] - ring[votes - 1, j], angle)
            s1, s2, r0, r1 = s1 + a, s2 + a * a, r0 + d, r1 + a * d
        slope = (s0 * r1 - s1 * r0) / (s0 * s2 - s1 * s1)
        level = (r0 - slope * s1) / s0
        values[j, at.SLOPE] = abs(slope) * span / (votes - 1)
        way = values[j, at.PATH] - paths[0, j]
        far = (votes - 1) * 10.0 * gate + 3.0 * way
        if limits[j, at.RATE] < np.inf:
            far = max(gate, limits[j, at.RATE] * span + way)
        if not abs(slope) * span <= far:
            return False
        for i in range(votes):
            a = (times[i, g] - newest) * 1e-9
            d = wrapped(ring[i, j] - ring[votes - 1, j], angle)
            if not abs(d - level - slope * a) <= gate + 0.25 * way:
                return False
    return True


@njit(**COLD)
def nearest(y: float, expected: float, angle: bool, tried: Any) -> float:
    """How near measured/factor comes to what was expected, over all factors."""
    found = np.inf
    for k in range(at.FACTORS.shape[0]):
        if tried[k] != at.NEVER and (not angle or k == at.TURN):
            for f in (at.FACTORS[k], 1.0 / at.FACTORS[k]):
                found = min(found, max(1.0, abs(f)) * abs(wrapped(y / f - expected, angle)))
    return found


@njit(**COLD)
def sides(case: Case, g: int, size: int) -> bool:
    """A sample inside the gate, which has grown meanwhile: is it one of those that are contested?

    Judged by the output that stands out most: nearer to the last contested sample, or to a factor
    of what was expected, than to the prediction.
    """
    (limits, rules, _), values, room = case.settings, case.memory[0], case.sample[0]
    ring, last, most, found = case.board[0], int(rules[g, at.VOTE]) - 1, 0.0, False
    for k in range(size):
        j = room[k]
        nu = values[j, at.NU]
        if nu * nu > most * values[j, at.BASE]:
            most, angle = nu * nu / values[j, at.BASE], limits[j, at.ANGLE] > 0
            rest = wrapped(nu - ring[last, j], angle)
            expected = values[j, at.LAST] - nu
            rest = min(
                abs(rest), nearest(values[j, at.LAST], expected, angle, limits[j, at.TRIED :])
            )
            found = rest < 0.5 * abs(nu)
    return found and most > 4.0


@njit(**COLD)
def widen(case: Case, g: int, size: int, phase: int) -> bool:
    """Too many samples outside: the noise has risen, the gate is set anew (never switched off)."""
    (variance, counts, _), room = case.statistics, case.sample[0]
    values, numbers, figures = case.memory
    share = 1.0 / (4.0 * case.settings[1][g, at.VOTE])
    figures[g, at.OUTSIDE] += (1.0 - figures[g, at.OUTSIDE]) * share
    if figures[g, at.OUTSIDE] <= 0.3:
        return False
    figures[g, at.OUTSIDE] = 0.15
    numbers[g, at.WIDENED] = numbers[g, at.SAMPLES]
    pool = variance.shape[0] - 1
    for k in range(size):
        j = room[k]
        variance[pool, j] *= 2.0
        values[j, at.SQUARE] *= 2.0
        counts[pool, j] = min(counts[pool, j], 100)
        if phase != pool:
            variance[phase, j] *= 2.0
            counts[phase, j] = min(counts[phase, j], 100)
    return True


@njit(**COLD)
def is_loud(rules: Any, memory: Any, g: int) -> bool:
    """Are the contested samples without verdict more than a few of the sensor's own noise?"""
    many = memory[1][g, at.BATCH] >= rules[g, at.VOTE]
    return bool(many or memory[2][g, at.LOUDEST] > LOUD)


@njit(**HOT)
def forgive_early(case: Case, g: int, size: int) -> None:
    """The one doubted sample, the last that came, was none where the model is a sample later.

    An input acts from its stamp on, so the model follows its leap at the next row; an output that
    goes by the input itself, as a current by a voltage, leaps with it. It moves on meanwhile.
    """
    (limits, rules, _), (values, numbers, _) = case.settings, case.memory
    last, count = int(rules[g, at.VOTE]) - 1, numbers[g, at.BATCH]
    alone = count == 1 and case.board[2][last, g] == numbers[g, at.LAST_AT]
    factor = count == 0 and numbers[g, at.CAUSE] == FACTOR and numbers[g, at.TOLD] == 0
    if not (alone or (factor and numbers[g, at.FAULTS] == 1)):
        return
    for k in range(size):
        j = case.sample[0][k]
        gate, angle = rules[g, at.GATE] * np.sqrt(values[j, at.BASE]), limits[j, at.ANGLE] > 0
        off = wrapped(values[j, at.LAST] - case.sample[1][j] + values[j, at.NU], angle)
        if not abs(off) <= max(gate, ONWARD * abs(values[j, at.WRONG])):
            return
    if factor:
        numbers[g, at.CAUSE] = numbers[g, at.FAULTS] = 0
    numbers[g, at.CONTEST] = numbers[g, at.BATCH] = 0


@njit(**COLD)
def end_contest(case: Case, g: int, now: Any) -> None:
    """The contest is over without agreement: its samples were measurement errors."""
    numbers, rules = case.memory[1], case.settings[1]
    if numbers[g, at.BATCH] > 0 and is_loud(rules, case.memory, g):
        newest = case.board[3][int(rules[g, at.VOTE]) - 1, g]
        span = (numbers[g, at.BATCH_ROW], newest, numbers[g, at.BATCH])
        note(case, now, ERROR, g, VOTE, span)
    numbers[g, at.CONTEST] = numbers[g, at.BATCH] = 0


@njit(**COLD)
def fault(case: Case, g: int, cause: int, onset: int, now: Any) -> None:
    """One more sample with an obvious error; told once, at its end or when it lasts."""
    numbers = case.memory[1]
    if numbers[g, at.CAUSE] != cause:
        end_fault(case, g, now)
        numbers[g, at.CAUSE], numbers[g, at.ONSET] = cause, onset
        numbers[g, at.FAULTS] = numbers[g, at.TOLD] = 0
        case.memory[2][g, at.SOUND_BY] = 0.0
    numbers[g, at.FAULTS] += 1
    numbers[g, at.ERRORS] += 1
    numbers[g, at.UNTIL] = now[0]
    if numbers[g, at.TOLD] == 0 and numbers[g, at.FAULTS] >= case.settings[1][g, at.VOTE]:
        numbers[g, at.TOLD] = 1
        span = (numbers[g, at.ONSET], now[0], numbers[g, at.FAULTS])
        note(case, now, ERROR, g, END if numbers[g, at.AT_END] > 0 else cause, span)


@njit(**COLD)
def end_fault(case: Case, g: int, now: Any) -> None:
    """The fault is over."""
    numbers = case.memory[1]
    if numbers[g, at.CAUSE] == 0:
        return
    span = (numbers[g, at.ONSET], numbers[g, at.UNTIL], numbers[g, at.FAULTS])
    kind = RESTORED if numbers[g, at.TOLD] else ERROR
    note(case, now, kind, g, END if numbers[g, at.AT_END] > 0 else numbers[g, at.CAUSE], span)
    numbers[g, at.CAUSE] = numbers[g, at.FAULTS] = numbers[g, at.TOLD] = numbers[g, at.AT_END] = 0
