"""Compiled: what was measured at a row is judged, and adopted where that is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit
from evertwin.fold import Mark
from evertwin.sync import places as at
from evertwin.sync.arbiter.arbiter_loop import FIRST
from evertwin.sync.arbiter.beside_loop import (
    CREPT,
    JUMPED,
    STARTED,
    begin,
    is_doubtful,
    outcome,
    turn_back,
)
from evertwin.sync.arbiter.free_loop import begins_free, starts_free
from evertwin.sync.arbiter.plausible_loop import grown, variance_of
from evertwin.sync.arbiter.run_loop import keep_start
from evertwin.sync.arbiter.vote_loop import note
from evertwin.sync.horizon.horizon_loop import NEVER, wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Finding
from evertwin.sync.workspace import Case, Workspace, fill

ABSENT, OVERRULED, ERROR = int(Mark.ABSENT), int(Mark.OVERRULED), int(Mark.ERROR)
PAUSES, LEAST, REMEMBERS, GROWS = 5, 10**9, 512, 4
"""Without a time-out, a group is missed after so many of its longest usual pauses, and so long [ns]
at least; samples that a pause is remembered for; times it that a single longer one counts."""
FOUND_STALE = int(Finding.STALE)


@njit(**HOT)
def present(members: Any, g: int, measured: Any, marked: Any, room: Any) -> int:
    """Fills ``room`` with the group's samples of this row: how many, or −1 if one is broken."""
    size = 0
    for c in range(members.shape[1]):
        j = members[g, c]
        if j < 0:
            break
        if marked[j] == ERROR:
            return -1
        if np.isfinite(measured[j]) and (marked[j] == 0 or marked[j] == OVERRULED):
            room[size] = j
            size += 1
    return size


@njit(**COLD)
def refuse(members: Any, g: int, marks: Any, i: int) -> None:
    """One value of the group was refused by its source, so none of this row is believed."""
    for k in range(members.shape[1]):
        j = members[g, k]
        if j >= 0 and marks[i, j] != ABSENT:
            marks[i, j] = ERROR


@njit(**HOT)
def age(work: Workspace, g: int, now: Any) -> float:
    """Seconds since the last trusted sample, NaN before the first; tells when that is too long."""
    rules, numbers = work.case.settings[1], work.case.memory[1]
    if numbers[g, at.VALID] == 0:
        return np.nan
    seconds = (now[1] - numbers[g, at.GOOD_AT]) * 1e-9
    absent, usual = now[1] - numbers[g, at.HEARD], numbers[g, at.PAUSE]
    late = seconds > rules[g, at.TIMEOUT]
    if rules[g, at.TIMEOUT] == 0.0:
        late = numbers[g, at.SAMPLES] >= at.LEARN and absent > max(PAUSES * usual, LEAST)
    if late and numbers[g, at.VALID] == 1:
        numbers[g, at.VALID] = 2
        known = absent // 1_000_000 if rules[g, at.TIMEOUT] == 0.0 else 0
        note(work.case, now, FOUND_STALE, g, 0, (now[0], now[0], known))
    return float(seconds)


@njit(**HOT)
def hear(numbers: Any, g: int, stamp: int) -> None:
    """A sample of the group came: how long its pauses usually are."""
    passed, usual = stamp - numbers[g, at.HEARD], numbers[g, at.PAUSE]
    if numbers[g, at.HEARD] != NEVER and passed > 0:
        # what it fails for once is no usual pause
        passed = min(passed, GROWS * usual) if usual > 0 else passed
        numbers[g, at.PAUSE] = max(usual - usual // REMEMBERS, passed)
    numbers[g, at.HEARD] = stamp


@njit(**HOT)
def review(case: Case, g: int, size: int, now: Any) -> float:
    """What a sample says of the one that was believed last: see `outcome`; an error is mended."""
    found = outcome(case, g, size, now[1])
    if found != 0.0:
        turn_back(case, g, size, now, found)
    return float(found)


@njit(**HOT)
def keep_beside(case: Case, g: int, size: int, now: Any, verdict: int, done: int) -> None:
    """A sample that may be no good is adopted: the state before goes on beside."""
    starts = done == FIRST
    if is_doubtful(case, g, size, verdict, starts):
        how = STARTED if starts else JUMPED if verdict == OVERRULED else CREPT
        begin(case, g, size, now, how, done > 0)


@njit(**HOT)
def mark(work: Workspace, i: int, g: int, size: int, verdict: int, done: int) -> None:
    """What comes out of a group's sample; −1: it is broken."""
    case, out = work.case, work.out
    room, measured, predicted, _ = case.sample
    out.update[i, g] = done
    if size < 0:
        refuse(work.members, g, out.mark, i)
    for k in range(size):
        j = room[k]
        out.mark[i, j] = verdict
        if verdict == 0 and (done != FIRST or case.x.shape[0] == 0):
            off = measured[j] - predicted[j]
            out.residual[i, j] = wrapped(off, case.settings[0][j, at.ANGLE] > 0)


@njit(**HOT)
def adopt(work: Workspace, row: int) -> None:
    """What was taken of the row goes into the state; into the others what is no matter of them."""
    stateful, numbers, members = work.case.x.shape[0] > 0, work.case.memory[1], work.members
    rules, values, taken = work.case.settings[1], work.case.memory[0], False
    predicted, take, expects = work.case.sample[2], work.case.sample[3], work.case.expects
    for j in range(values.shape[0]):
        values[j, at.AFTER] = take[j] if take[j] == take[j] else predicted[j]
        taken = taken or take[j] == take[j]
    if not stateful:
        return
    for g in range(numbers.shape[0] if taken else 0):
        if numbers[g, at.FREE] > 0:
            fill(expects, take)
            for k in range(members.shape[1]):
                if members[g, k] >= 0:
                    expects[members[g, k]] = np.nan
            call(work.observe, work.context, work.free[g].ctypes.data, expects.ctypes.data)
    if taken:
        call(work.observe, work.context, work.case.x.ctypes.data, take.ctypes.data)
        matter = work.case.told[1]
        if matter[at.OWNER] > 0:
            # where a base starts, which way it goes is no question of a factor
            begins = matter[at.HOW] == STARTED and matter[at.SINCE] == row
            for k in range(members.shape[1]):
                j = members[matter[at.OWNER] - 1, k]
                if j >= 0 and not (begins and work.case.settings[0][j, at.ANGLE] > 0):
                    take[j] = np.nan
            call(work.observe, work.context, work.case.beside.ctypes.data, take.ctypes.data)
    for g in range(numbers.shape[0]):
        if numbers[g, at.FREE] == 0 and begins_free(rules, work.case.memory, members, g):
            fill(work.free[g], work.case.x)
            starts_free(values, members, g)


@njit(**HOT)
def spread_of(work: Workspace, g: int, j: int, phase: int, growth: float) -> float:
    """Variance that the arbiter expects of measured − predicted."""
    (limits, rules, _), values = work.case.settings, work.case.memory[0]
    spread = variance_of(work.case.statistics[0], work.case.statistics[1], phase, j) * growth
    spread += values[j, at.OFFSET] * values[j, at.OFFSET]
    if rules[g, at.USE] == at.MIX and limits[j, at.ADOPTS] > 0:
        spread = values[j, at.SQUARE] * growth
    if values[j, at.POWER] > 0:
        # The model's own error goes on while nothing is measured.
        drift = values[j, at.CROSS] / values[j, at.POWER] * values[j, at.PATH]
        spread += drift * drift
    return float(spread)


@njit(**HOT)
def expect(work: Workspace, i: int, now: Any, phase: int) -> None:
    """Age and spread of each group, as they are after the row."""
    rules, memory, out = work.case.settings[1], work.case.memory, work.out
    for g in range(rules.shape[0]):
        out.age[i, g] = age(work, g, now)
        growth = grown(rules, memory[1], memory[2], g, now[1]) if out.age[i, g] >= 0 else np.inf
        for k in range(work.members.shape[1]):
            j = work.members[g, k]
            if j < 0:
                break
            keep_start(memory[0], memory[1], g, j, now[0])
            out.sigma[i, j] = np.sqrt(spread_of(work, g, j, phase, growth))
