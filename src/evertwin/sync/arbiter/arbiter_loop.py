"""Compiled: one sample of one group through the four steps of `evertwin.sync.arbiter.arbiter`.

See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.fold import Mark
from evertwin.sync import places as at
from evertwin.sync.arbiter.ends_loop import is_at_end
from evertwin.sync.arbiter.factor_loop import blamed, persists, scaled, weigh, weigh_anew
from evertwin.sync.arbiter.plausible_loop import (
    doubted,
    extend,
    grown,
    implausible,
    learn,
    mark_onset,
    measure,
)
from evertwin.sync.arbiter.run_loop import EQUAL, follow, learn_noise, withdraw
from evertwin.sync.arbiter.vote_loop import (
    agrees,
    end_contest,
    end_fault,
    fault,
    forgive_early,
    note,
    remember,
    sides,
    widen,
)
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Cause, Finding
from evertwin.sync.workspace import Case

OK, CONTESTED = int(Mark.OK), int(Mark.CONTESTED)
OVERRULED, ERROR = int(Mark.OVERRULED), int(Mark.ERROR)
ADOPTED, BLENDED, RESET, FIRST = 1, 2, 3, 4
NONE, SYNTAX, RATE, VOTE = map(int, (Cause.NONE, Cause.SYNTAX, Cause.RATE, Cause.VOTE))
FROZEN, FACTOR = int(Cause.FROZEN), int(Cause.FACTOR)
RECENT = 300
"""Samples that the mean square of measured − predicted remembers."""
NEWEST = 8
"""Innovations that the newest mean remembers."""
QUICKLY = 20
"""Samples in which the usual path rises; it falls over the memory of the variance."""
FOUND_ERROR, FOUND_OVERRULED = int(Finding.ERROR), int(Finding.OVERRULED)
FOUND_FRESH, FOUND_WIDER = int(Finding.FRESH), int(Finding.WIDER)


@njit(**COLD)
def forget(case: Case, g: int, now: Any) -> None:
    """The state starts anew: what is open is closed, and the next sample is adopted as it is."""
    end_contest(case, g, now)
    end_fault(case, g, now)
    numbers = case.memory[1]
    numbers[g, at.STARTED] = numbers[g, at.FREE] = 0
    for kind in range(2):
        numbers[g, at.RUN + kind] = numbers[g, at.STOOD + kind] = 0


@njit(**HOT)
def settle(case: Case, g: int, size: int, stamp: int, adopt: bool, spread: float) -> None:
    """A trusted sample: adopt it where asked and possible; keep how far it is off after that."""
    limits, (values, numbers, figures) = case.settings[0], case.memory
    room, y, predicted, take = case.sample
    for k in range(size):
        j = room[k]
        if adopt and limits[j, at.ADOPTS] > 0:
            take[j] = y[j]
        after = take[j] if take[j] == take[j] else predicted[j]
        off = wrapped(y[j] - after, limits[j, at.ANGLE] > 0)
        values[j, at.OFFSET] = off if off == off else 0.0
        values[j, at.GOOD], values[j, at.PATH], values[j, at.WAY] = y[j], 0.0, 0.0
        values[j, at.DRIFT] = 0.0
    figures[g, at.SPREAD] = spread
    numbers[g, at.STARTED], numbers[g, at.GOOD_AT] = 1, stamp
    numbers[g, at.SAMPLES] += 1


@njit(**HOT)
def moderated(values: Any, j: int, off: float) -> float:
    """The difference that a blend follows: of a sudden change, at first only what is usual.

    If the next sample confirms it, it is followed; a single outlier is not.
    """
    bound = 2.0 * np.sqrt(values[j, at.BASE])
    usual = values[j, at.OFFSET] + min(max(values[j, at.NU], -bound), bound)
    return float(usual if abs(usual) < abs(off) else off)


@njit(**HOT)
def use(case: Case, g: int, size: int, stamp: int) -> int:
    """A sample inside the gate: nothing, a tolerance update, or a blend."""
    (limits, rules, _), (values, numbers, figures) = case.settings, case.memory
    room, y, predicted, take = case.sample
    share, elapsed = rules[g, at.BLEND], float(stamp - numbers[g, at.GOOD_AT])
    known = figures[g, at.INTERVAL]
    steps = elapsed / known if known > 0 else 1.0
    # A pause is no regular interval.
    limited = min(elapsed, 3.0 * known)
    figures[g, at.INTERVAL] = known + (limited - known) / 32.0 if known > 0 else elapsed
    few = min(numbers[g, at.SAMPLES], RECENT)
    extend(limits, values, numbers, case.sample, g, size)
    for k in range(size):
        j = room[k]
        nu, move = values[j, at.NU], values[j, at.MOVE]
        values[j, at.CROSS] += (nu * move - values[j, at.CROSS]) / few
        values[j, at.POWER] += (move * move - values[j, at.POWER]) / few
        more = values[j, at.PATH] / max(steps, 1.0) - values[j, at.USUAL]
        values[j, at.USUAL] += more / (QUICKLY if more > 0 else at.MEMORY)
        values[j, at.PROVEN] -= values[j, at.PROVEN] / at.MEMORY
        values[j, at.LEAN] += (nu - values[j, at.LEAN]) / NEWEST
        values[j, at.LEANS] *= 1.0 - 1.0 / RECENT
        beyond = abs(values[j, at.LEAN]) - 3.0 * np.sqrt(values[j, at.BASE] / (2.0 * NEWEST))
        values[j, at.LEANS] = max(values[j, at.LEANS], beyond)
    adopt = False
    if rules[g, at.USE] == at.MIX:
        spread = figures[g, at.SPREAD] + share * share / (1.0 - share) * steps
        gain = spread / (1.0 + spread)
        for k in range(size):
            j = room[k]
            off = wrapped(y[j] - predicted[j], limits[j, at.ANGLE] > 0)
            if limits[j, at.ADOPTS] > 0:
                known = values[j, at.SQUARE] < np.inf
                more = off * off - (values[j, at.SQUARE] if known else 0.0)
                values[j, at.SQUARE] = values[j, at.SQUARE] + more / few if known else more
                # While the variance is not known, the measurement is all there is.
                weight = gain if values[j, at.BASE] < np.inf else 1.0
                take[j] = predicted[j] + weight * moderated(values, j, off)
                adopt = True
        settle(case, g, size, stamp, False, gain)
        return BLENDED if adopt else 0
    if rules[g, at.USE] == at.UPDATE:
        for k in range(size):
            j = room[k]
            off = abs(wrapped(y[j] - predicted[j], limits[j, at.ANGLE] > 0))
            adopt = adopt or (limits[j, at.ADOPTS] > 0 and off > limits[j, at.TOLERANCE])
    settle(case, g, size, stamp, adopt, share)
    numbers[g, at.UPDATES] += adopt
    return ADOPTED if adopt else 0


@njit(**COLD)
def concede(limits: Any, values: Any, room: Any, size: int) -> None:
    """Overruled: the machine moves beside the model as fast as the samples that agreed.

    After a mere jump that is next to nothing; where the machine moves otherwise than the model
    predicts, the same is not contested again and again. An output that no state adopts did not
    move: there the jump itself is what the model does not know.
    """
    for k in range(size):
        j = room[k]
        size_of = values[j, at.SLOPE] if limits[j, at.ADOPTS] > 0 else abs(values[j, at.NU])
        values[j, at.PROVEN] = max(values[j, at.PROVEN], size_of)


@njit(**COLD)
def contest(case: Case, g: int, size: int, now: Any, phase: int) -> tuple[int, int]:
    """A sample outside the gate: the vote."""
    (limits, rules, _), (values, numbers, figures) = case.settings, case.memory
    room, rows, votes = case.sample[0], case.board[3], int(rules[g, at.VOTE])
    remember(case, g, size, now)
    full = numbers[g, at.CONTEST] >= votes
    if full:
        growth = grown(rules, numbers, figures, g, now[1])
        factor = scaled(case, g, size, growth)
        if factor != 0.0:
            onset = numbers[g, at.BATCH_ROW]
            for _ in range(blamed(case.memory, g, factor)):
                fault(case, g, FACTOR, onset, now)
            return ERROR, 0
        end_fault(case, g, now)
    agreed = full and agrees(case, g, size)
    # What left the vote without agreement was an error, told for all of them at once; a few before
    # an agreement were on the way to it.
    late = numbers[g, at.BATCH] - votes
    if late >= votes:
        span = (numbers[g, at.BATCH_ROW], numbers[g, at.LEFT], late)
        note(case, now, FOUND_ERROR, g, VOTE, span)
        numbers[g, at.BATCH_ROW], numbers[g, at.BATCH] = rows[0, g], votes
    if agreed:
        note(case, now, FOUND_OVERRULED, g, 0, (rows[0, g], now[0], votes))
        numbers[g, at.CONTEST] = numbers[g, at.BATCH] = 0
        numbers[g, at.RESETS] += 1
        figures[g, at.OUTSIDE] = 0.0
        concede(limits, values, room, size)
        weigh_anew(limits, values, case.board, room, size, votes)
        refresh(case, g, now)
        settle(case, g, size, now[1], True, 1.0)
        return OVERRULED, RESET
    if numbers[g, at.CAUSE] != FACTOR and widen(case, g, size, phase):
        note(case, now, FOUND_WIDER, g, 0, (now[0], now[0], 0))
    return CONTESTED, 0


@njit(**COLD)
def refresh(case: Case, g: int, now: Any) -> None:
    """The group is valid (again)."""
    numbers = case.memory[1]
    if numbers[g, at.VALID] == 2:
        note(case, now, FOUND_FRESH, g, 0, (now[0], now[0], 0))
    numbers[g, at.VALID] = 1


@njit(**COLD)
def accuse(case: Case, g: int, size: int, cause: int, now: Any) -> None:
    """An obvious error; a frozen sensor was so since its run began.

    Where all its values end it may be there rightly, until it misses the way back.
    """
    numbers, onset = case.memory[1], now[0]
    begins, ends = numbers[g, at.CAUSE] != FROZEN, False
    numbers[g, at.FREE] = 0
    if cause == FROZEN:
        onset = numbers[g, at.RUN_ROW + numbers[g, at.HELD_BY]]
        ends = numbers[g, at.HELD_BY] == EQUAL
        ends = ends and is_at_end(case.settings[0], case.memory, case.sample[0], g, size)
        if begins:
            withdraw(case, g, size)
            if numbers[g, at.BATCH_ROW] >= onset:
                # What was contested since then is part of the same fault.
                numbers[g, at.CONTEST] = numbers[g, at.BATCH] = 0
        elif numbers[g, at.AT_END] > 0 and not ends:
            numbers[g, at.AT_END] = numbers[g, at.TOLD] = 0
    fault(case, g, cause, onset, now)
    if begins:
        numbers[g, at.AT_END] = ends


@njit(**HOT)
def judge(case: Case, g: int, size: int, now: Any, phase: int, teaches: bool) -> tuple[int, int]:
    """Mark and use of one sample; fills ``take`` with what the state adopts. ``size`` < 0: refused.

    Args:
        now: row and stamp.
        teaches: may it tell how far predictions are off? Not while an input may be in another unit,
            nor, until much is known, one that stays: that has no noise.
    """
    (limits, rules, _), (values, numbers, figures) = case.settings, case.memory
    (room, y, predicted, _), statistics = case.sample, case.statistics
    if size < 0:
        fault(case, g, SYNTAX, now[0], now)
        return ERROR, 0
    started, ratio = numbers[g, at.STARTED] > 0, 0.0
    for k in range(size):
        started = started and predicted[room[k]] == predicted[room[k]]
    if started:
        ratio = measure(case, g, size, now[1], phase)
        forgive_early(case, g, size)
    follow(case, g, size, now, ratio > 1.0)
    cause = implausible(case, g, size, now[1])
    open_factor, held = started and numbers[g, at.CAUSE] == FACTOR, 0
    # A factor may leave few digits that change, and makes any motion too fast.
    if open_factor and cause in (NONE, FROZEN, RATE):
        held = persists(case, g, size, grown(rules, numbers, figures, g, now[1]))
        cause = FACTOR if held > 0 else NONE if held == 0 and cause == RATE else cause
    if ratio > 1.0:
        mark_onset(values, numbers, case.sample, g, size)
        if cause in (NONE, RATE):
            cause = doubted(case.settings, case.memory, case.sample, g, size) or cause
    for k in range(size):
        values[room[k], at.LAST] = y[room[k]]
    numbers[g, at.LAST_AT] = now[1]
    if cause > 0 or ratio > 1.0:
        for k in range(size):
            values[room[k], at.WRONG] = values[room[k], at.NU]
            values[room[k], at.NU_BEFORE] = np.nan
    if cause > 0:
        accuse(case, g, size, cause, now)
        return ERROR, 0
    if not open_factor or held < 0:
        end_fault(case, g, now)
    elif ratio <= 1.0:
        return CONTESTED, 0  # it may be sound again; the next rows say so
    outside = ratio > 1.0
    if not outside and numbers[g, at.CONTEST] > 0 and started:
        outside = sides(case, g, size)
    if outside:
        before = figures[g, at.LOUDEST] if numbers[g, at.BATCH] > 0 else 0.0
        figures[g, at.LOUDEST] = max(before, ratio)
        verdict, done = contest(case, g, size, now, phase)
        return int(verdict), int(done)
    if numbers[g, at.CONTEST] > 0:
        end_contest(case, g, now)
    if numbers[g, at.VALID] != 1:
        refresh(case, g, now)
    if not started:
        settle(case, g, size, now[1], True, 1.0)
        return OK, FIRST
    growth = grown(rules, numbers, figures, g, now[1])
    for k in range(size):
        j = room[k]
        if teaches and (values[j, at.ANEW] > 0 or statistics[1][-1, j] >= at.LEARN):
            learn(statistics, phase, j, values[j, at.NU] * values[j, at.NU] / growth)
        weigh(limits, values, j, y[j], predicted[j])
    learn_noise(values, numbers, room, g, size if teaches else 0)
    figures[g, at.OUTSIDE] *= 1.0 - 1.0 / (4.0 * rules[g, at.VOTE])
    return OK, use(case, g, size, now[1])
