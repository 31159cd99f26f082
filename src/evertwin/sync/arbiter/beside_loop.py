"""Compiled: what was believed, and the account beside it in which it was a measurement error.

A sample that is believed though it left what the sensor's noise explains (the vote overruled the
model, or the model's motion may be all wrong) can turn out to be an error later. So the state as it
would be without it is simulated beside, for one group at a time, until one of these is known:

* the samples come back to where this state expects them: the machine, or the sensor, was away for
  a while; either way the state beside is the right one from here on;
* they are a factor times what it expects. The line measured = level + slope·expected says so where
  it passes through zero, as the line of a machine that moves otherwise from where it stood does
  not; or where the noise is the factor's as well;
* neither, for long: what was believed stays.

See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays; ``other`` are the columns per
output and the integers of the account, see `evertwin.sync.places`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.fold import Mark
from evertwin.sync import places as at
from evertwin.sync.arbiter.factor_loop import COMMON
from evertwin.sync.arbiter.plausible_loop import leapt
from evertwin.sync.arbiter.vote_loop import end_contest, end_fault, fault, note
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Cause, Finding
from evertwin.sync.workspace import Case, fill

FACTOR, AWAY = int(Cause.FACTOR), int(Cause.AWAY)
ERROR = int(Finding.ERROR)
OK, OVERRULED, ERROR_MARK = int(Mark.OK), int(Mark.OVERRULED), int(Mark.ERROR)
CREPT, JUMPED, STARTED = 1, 2, 3
LONGEST = 1000
"""Rows after which what was believed stays."""
UNHEARD = 50.0
"""Factor by which no machine moves more than its model; one that sticks moves any part of it."""
FEW = 8
"""Rows from which the line is asked."""
STEADY = 0.3
"""Variance of the state at the beginning over that of the noise."""
SILENT = 0.1
"""Part of what predictions are off by, squared, that a sensor's noise is of at least."""
DIGITS = 1e-6
"""Part of a value that noise is of at least; nearer it is how numbers are rounded."""
NEAR = 0.2
"""How near to a factor the slope has to be, and be known [of the factor]."""


@njit(**HOT)
def is_doubtful(case: Case, g: int, size: int, verdict: int, starts: bool) -> bool:
    """Was a sample contested, or farther from the prediction than noise explains, and adopted?"""
    (limits, rules, _), values = case.settings, case.memory[0]
    room, y, predicted, _ = case.sample
    if starts:
        return bool(limits[room[0], at.ADOPTS] > 0)
    if verdict == ERROR_MARK or rules[g, at.USE] == at.NONE:
        return verdict == OVERRULED
    for k in range(size):
        j = room[k]
        off = wrapped(y[j] - predicted[j], limits[j, at.ANGLE] > 0)
        gate = rules[g, at.GATE] * rules[g, at.GATE] * values[j, at.BASE]
        if limits[j, at.ADOPTS] > 0 and (verdict != OK or off * off > gate):
            return True
    return False


@njit(**COLD)
def is_silent(values: Any, j: int, y: float) -> bool:
    """Has a sensor next to no noise of its own? What predictions are off by is the model's then,
    which goes on smoothly; that it is less than usual says nothing of a factor."""
    own, off = max(values[j, at.NOISE], 0.0), values[j, at.BASE]
    return bool(own < SILENT * off or off < DIGITS * DIGITS * y * y)


@njit(**COLD)
def begin(case: Case, g: int, size: int, now: Any, how: int, believed: bool) -> None:
    """From this row on, the state before anything of it is adopted goes on beside."""
    account, matter = case.told
    if matter[at.OWNER] > 0:
        if matter[at.OWNER] == g + 1:
            matter[at.HOW] = max(matter[at.HOW], how)  # a start stays one
        return
    limits, (values, numbers, _), (room, y, predicted, _) = (
        case.settings[0],
        case.memory,
        case.sample,
    )
    matter[at.OWNER], matter[at.SINCE], matter[at.SINCE_AT] = g + 1, now[0], now[1]
    matter[at.WEIGHED], matter[at.HOW] = 0, how
    matter[at.TRUSTED] = numbers[g, at.SAMPLES] - believed
    fill(case.beside, case.x)
    for k in range(size):
        j = room[k]
        account[j, :] = 0.0
        off = wrapped(y[j] - predicted[j], limits[j, at.ANGLE] > 0)
        account[j, at.BESIDE_OFF] = off - values[j, at.NU] if how != STARTED else 0.0
        # Of a few samples it is a guess that is far too large, by which any line is a factor's.
        # The one that starts now has told nothing of it, nor have the first two of all.
        guessed = numbers[g, at.SAMPLES] - 3 < at.LEARN or is_silent(values, j, y[j])
        guessed = guessed and how == STARTED
        account[j, at.BESIDE_NOISE] = np.inf if guessed else 0.5 * values[j, at.BASE]
        # What crept was followed for a while already.
        account[j, at.BESIDE_LAG] = abs(off) if how == CREPT and believed else 0.0
        account[j, at.BESIDE_FROM] = account[j, at.BESIDE_AFTER] = predicted[j]
        account[j, at.LEAPT_TO] = values[j, at.AWAY_AT] if how == JUMPED else y[j]
        account[j, at.LEAPT_FROM] = values[j, at.AWAY_FROM] if how == JUMPED else y[j]


@njit(**COLD)
def room_beside(rules: Any, memory: Any, other: Any, g: int, j: int, stamp: int) -> float:
    """How far a sound value may be off the state beside: its gate, a tenth of the way."""
    account, matter = other
    weight, interval, growth = rules[g, at.BLEND], memory[2][g, at.INTERVAL], 1.0
    if interval > 0:
        steps = (stamp - matter[at.SINCE_AT]) / interval
        growth = 1.0 + weight * weight * steps
    gate = rules[g, at.GATE] * math.sqrt(2.0 * account[j, at.BESIDE_NOISE] * growth)
    return float(gate + 0.1 * account[j, at.BESIDE_PATH])


@njit(**COLD)
def weigh(limits: Any, account: Any, sample: Any, expects: Any, size: int, rows: int) -> None:
    """One more row of the line measured = level + slope·expected, by means and products."""
    room, y = sample[0], sample[1]
    for k in range(size):
        j = room[k]
        moved = wrapped(expects[j] - account[j, at.BESIDE_AFTER], limits[j, at.ANGLE] > 0)
        if moved == moved:
            account[j, at.BESIDE_PATH] += abs(moved)
        account[j, at.BESIDE_AFTER] = expects[j]
        dx = expects[j] + account[j, at.BESIDE_OFF] - account[j, at.MEAN_X]
        dy = y[j] - account[j, at.MEAN_Y]
        account[j, at.MEAN_X] += dx / rows
        account[j, at.MEAN_Y] += dy / rows
        rest = 1.0 - 1.0 / rows
        account[j, at.XX] += rest * dx * dx
        account[j, at.XY] += rest * dx * dy
        account[j, at.YY] += rest * dy * dy


@njit(**COLD)
def is_factor(
    rules: Any, account: Any, g: int, j: int, rows: int, f: float, starts: bool
) -> bool:  # fmt: skip
    """Do the rows of an output say that it is ``f`` times what is expected beside?

    For 1: do they say that it moves as the model does? Where a model ``starts``, its place is not
    known, and off the line is what it does wrong as well: only what is off from row to row is
    noise. A noise that is not known either leaves factors that no machine could have.
    """
    xx, noise = account[j, at.XX], account[j, at.BESIDE_NOISE]
    gate, size = rules[g, at.GATE], abs(f)
    if rows < FEW or not xx > 0:
        return False
    slope = account[j, at.XY] / xx
    rest = max(account[j, at.YY] - slope * account[j, at.XY], 0.0)
    if not abs(slope / f - 1.0) + gate * math.sqrt(rest / ((rows - 2) * xx)) / size <= NEAR:
        return False
    if f == 1.0:
        return True
    rest = min(rest, account[j, at.SCATTER]) if starts else rest
    heard = 0.5 * rest * (1.0 - 1.0 / (size * size)) / noise - (rows - 2) * math.log(size)
    if starts:
        return bool(heard > COMMON if noise < np.inf else size > UNHEARD)
    start, mean = account[j, at.BESIDE_FROM] + account[j, at.BESIDE_OFF], account[j, at.MEAN_X]
    level = account[j, at.MEAN_Y] - slope * mean
    sure = 1.0 / rows + mean * mean / xx + STEADY
    near = gate * math.sqrt(noise * sure) + account[j, at.BESIDE_LAG] + 0.1 * abs(start)
    near *= size
    if not abs(level) <= near:
        return False
    apart = abs(start * (1.0 - f)) > 2.0 * near
    # A machine whose command is off by a factor starts from zero as well, but keeps the noise.
    return bool(heard > COMMON if size != 1.0 else apart)


@njit(**COLD)
def outcome(case: Case, g: int, size: int, stamp: int) -> float:
    """0: not known yet; 1: the samples came back to the state beside; else the factor they have."""
    (limits, rules, _), memory, sample = case.settings, case.memory, case.sample
    (values, numbers, _), (account, matter), expects = memory, case.told, case.expects
    room, y, predicted, _ = sample
    matter[at.WEIGHED] += 1
    rows = matter[at.WEIGHED]
    back, away, far, alone = True, False, False, False
    for k in range(size):
        j = room[k]
        angle, near = limits[j, at.ANGLE] > 0, room_beside(rules, memory, case.told, g, j, stamp)
        expected = expects[j] + account[j, at.BESIDE_OFF]
        back = back and abs(wrapped(y[j] - expected, angle)) <= near
        apart = abs(wrapped(predicted[j] + values[j, at.OFFSET] - expected, angle))
        off = abs(wrapped(y[j] - predicted[j] - values[j, at.OFFSET], angle))
        account[j, at.SCATTER] += 0.5 * off * off
        away = away or (apart > 2.0 * near and off > 0.5 * apart)
        far = far or apart > 2.0 * near
        alone = alone or (numbers[g, at.CONTEST] == 0 and off > near)
    starts = matter[at.HOW] == STARTED
    if back and away and not starts:
        return 1.0
    if matter[at.HOW] == JUMPED and not far:
        matter[at.OWNER] = 0
        return 0.0
    if alone and not starts:
        matter[at.WEIGHED] -= 1  # a spike is no point of a line
        return 0.0
    weigh(limits, account, sample, expects, size, rows)
    for k in range(size):
        j = room[k]
        if limits[j, at.ANGLE] > 0 or not limits[j, at.ADOPTS] > 0:
            continue
        if matter[at.HOW] != JUMPED and is_factor(rules, account, g, j, rows, 1.0, starts):
            matter[at.OWNER] = 0
            return 0.0
        guessed = starts and not account[j, at.BESIDE_NOISE] < np.inf
        if guessed and not limits[j, at.MOVED_BY] > 0:
            continue
        before, first = account[j, at.LEAPT_FROM], account[j, at.LEAPT_TO]
        found, least, slope = 0.0, np.inf, account[j, at.XY] / max(account[j, at.XX], 1e-300)
        for c in range(at.FACTORS.shape[0]):
            for f in (at.FACTORS[c], 1.0 / at.FACTORS[c]):
                off = abs(slope / f - 1.0)
                if limits[j, at.TRIED + c] == at.NEVER or not off < least:
                    continue
                if not starts and not leapt(limits, values, j, before, first, f):
                    continue
                if is_factor(rules, account, g, j, rows, f, starts):
                    found, least = float(f), off
        if found != 0.0:
            return found
    if rows >= LONGEST:
        matter[at.OWNER] = 0
    return 0.0


@njit(**COLD)
def turn_back(case: Case, g: int, size: int, now: Any, found: float) -> None:
    """What was believed was an error: the state beside is the state, and the fault is told."""
    (limits, rules, _), (values, numbers, figures) = case.settings, case.memory
    (account, matter), expects = case.told, case.expects
    room, y, predicted, take = case.sample
    fill(case.x, case.beside)
    fill(predicted, expects)
    for k in range(size):
        j = room[k]
        values[j, at.WRONG] = values[j, at.NU]
        values[j, at.OFFSET] = account[j, at.BESIDE_OFF]
        values[j, at.PATH] = account[j, at.BESIDE_PATH]
        values[j, at.WAY] = account[j, at.BESIDE_AFTER] - account[j, at.BESIDE_FROM]
        values[j, at.PROVEN] = 0.0
        values[j, at.NU_BEFORE] = np.nan
        values[j, at.DRIFT] = 0.0
    numbers[g, at.GOOD_AT] = matter[at.SINCE_AT]
    end_contest(case, g, now)
    matter[at.OWNER] = 0
    rows = numbers[g, at.SAMPLES] - matter[at.TRUSTED]
    numbers[g, at.ERRORS] += rows
    if found == 1.0:
        if rows < rules[g, at.VOTE] and matter[at.HOW] == CREPT:
            return  # less than what it moves in a row or two: one that answered late
        span = (matter[at.SINCE], now[0] - 1, rows)
        note(case, now, ERROR, g, AWAY, span)
        return
    starts = matter[at.HOW] == STARTED
    if numbers[g, at.CAUSE] == FACTOR:
        end_fault(case, g, now)
    figures[g, at.FACTOR] = found
    for k in range(size):
        j = room[k]
        if starts and limits[j, at.ADOPTS] > 0:
            # The place of the start is what the sensor says, divided by its factor.
            predicted[j] += account[j, at.MEAN_Y] / found - account[j, at.MEAN_X]
            take[j] = predicted[j]
        else:
            values[j, at.DRIFT] = y[j] / found - expects[j] - account[j, at.BESIDE_OFF]
        variance, counts, _ = case.statistics
        if starts and account[j, at.BESIDE_NOISE] < np.inf:
            # What was learned meanwhile is the factor's noise.
            variance[:, j], counts[:, j] = 2.0 * account[j, at.BESIDE_NOISE], at.LEARN
    fault(case, g, FACTOR, matter[at.SINCE], now)
    numbers[g, at.FAULTS] += rows
