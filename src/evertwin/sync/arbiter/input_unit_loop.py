"""Compiled: in which unit is an input that left its range, or is it in none?

Where an input is suddenly far outside what it was, each factor of a change of its units that brings
it back is a hypothesis of its own: the row is predicted with the input divided by it. So are the
input as it is recorded, as it was before, and none at all, as of a machine that is blocked. Each is
scored by how unlikely the samples are beside what it predicts from those of the row before. A row
says only so much.

Far outside, the best of them stands in the input's place at once. Nearer, machines go as well: by a
limit on a speed one command looks divided by a factor, but no two that differ; so two are asked
for, or a leap by that factor.

See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit
from evertwin.sync import places as at
from evertwin.sync.arbiter.plausible_loop import grown, variance_of
from evertwin.sync.arbiter.run_loop import step_of
from evertwin.sync.horizon.horizon_loop import is_known, wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.workspace import Workspace, advance, fill

REACH = 10.0
"""Widths of its range by which an input is outside it that no machine was meant to follow."""
MARGIN = 0.1
"""Widths of its range by which an input leaves it at least, where it is in another unit."""
ASIDE = 0.5
"""Widths by which it may be outside all the same, divided by its factor."""
LONGEST = 1000
"""Rows after which a doubt gives way, and a question is asked anew: what lasts may be the
machine's as well."""
CLEAR, SURE, DECIDED = 4.0, 8.0, 50.0
"""The most that a sample may say about a factor, the evidence from which one is told, and from
which nothing more is asked [log]."""
ALIKE = 0.15
"""How near to a factor an input has to rise all at once: it may have moved by itself as well. What
differs by more are two values."""
ENOUGH = 100
"""Believed rows from which the range is known, since the machine moved: that of a machine at rest
is its command's noise."""
LEVELS, LEVEL = 10, 0.1
"""Levels that it takes, too: of a command in steps, few rows are few values; share of its range
that parts two."""
APART = 30.0
"""Widths by which a value is outside the range of fewer: a step to ten times the last is not."""
OFTEN, LIVELY = 4, 0.25
"""Rows of which one says whether a model is in scale, and where that is known, such rows of which
one does; share of the largest value of its range from which on an input does much."""
RECORDED, HELD, NOTHING, UNKNOWN, UNITS = range(5)
"""Hypotheses: the input as recorded, as it was, none, one that nobody knows; from then on, divided
by each factor."""
VAGUE = 0.65
"""How unlikely a sample is beside what is not known [−log]; what is known makes that 0.5."""


@njit(**HOT)
def is_beyond(inputs: Any, counts: Any, k: int, u: float, widths: float) -> bool:
    """Is a value outside the known range of its input, by more than so many widths of it?"""
    low, high = inputs[k, at.LOWEST], inputs[k, at.HIGHEST]
    if counts[k, at.MOVING] < ENOUGH or not high > low:
        return False
    away = (widths if counts[k, at.CHANGES] >= LEVELS else max(widths, APART)) * (high - low)
    return bool(u > high + away or u < low - away)


@njit(**COLD)
def risen_by(value: float, before: float, divides: Any) -> int:
    """The hypothesis of the factor that is nearest between a value and the one before; 0: none.

    Args:
        divides: of each factor, whether it is one of this input's units.
    """
    found, least = 0, ALIKE
    if before != 0.0:
        for c in range(at.FACTORS.shape[0] - 1):
            away = abs(value / before / at.FACTORS[c] - 1.0)
            if away <= least and divides[c] > 0:
                found, least = UNITS + c, away
    return found


@njit(**COLD)
def is_fresh(memory: Any, row: Any, g: int) -> bool:
    """Was the newest sample of a group at the row before?"""
    now, passed = row[3], row[5]
    since = now[1] - memory[1][g, at.LAST_AT] - passed
    return bool(memory[1][g, at.STARTED] > 0 and abs(since) < 1000.0)  # [ns]


@njit(**COLD)
def measured_before(work: Workspace, row: Any, start: Any, y: Any) -> None:
    """Fills ``start`` with the state that has adopted the samples of the row before, so that rows
    which were predicted wrongly do not count again."""
    members, memory, limits = row[0], work.case.memory, work.case.settings[0]
    values = memory[0]
    fill(start, work.case.x)
    for j in range(y.shape[0]):
        y[j] = np.nan
    for g in range(members.shape[0]):
        fresh = is_fresh(memory, row, g)
        for c in range(members.shape[1]):
            j = members[g, c]
            if j >= 0 and fresh and limits[j, at.ADOPTS] > 0:
                y[j] = values[j, at.LAST]
    call(work.observe, work.context, start.ctypes.data, y.ctypes.data)


@njit(**COLD)
def surprise(work: Workspace, row: Any, predicted: Any, asked: bool) -> float:
    """How unlikely the row's samples are beside a prediction [−log], each by `CLEAR` at most; or,
    where that is not ``asked``, how many count.

    Args:
        row: members of the groups, what was measured, its marks, row and stamp, phase, time [ns]
            since the row before.
    """
    settings, memory, statistics = work.case.settings, work.case.memory, work.case.statistics
    members, measured, marked, now, phase, _ = row
    values, numbers, figures = memory
    found = 0.0
    for g in range(members.shape[0]):
        growth = grown(settings[1], numbers, figures, g, now[1])
        for c in range(members.shape[1]):
            j = members[g, c]
            if j < 0:
                break
            base = variance_of(statistics[0], statistics[1], phase, j)
            coarse = step_of(values, j)
            base = max(base, coarse * coarse / 12.0)
            if marked[j] != 0 or not 0 < base < np.inf or numbers[g, at.STARTED] == 0:
                continue
            if measured[j] != measured[j]:
                continue
            off, fresh = measured[j] - predicted[j], settings[0][j, at.ADOPTS] > 0
            fresh = fresh and is_fresh(memory, row, g)
            off -= 0.0 if fresh else values[j, at.OFFSET]
            off = wrapped(off, settings[0][j, at.ANGLE] > 0)
            said = 0.5 * off * off / (base if fresh else base * growth)
            found += (said if said < CLEAR else CLEAR) if asked else 1.0
    return found


@njit(**COLD)
def is_asked(inputs: Any, counts: Any, k: int, u: float) -> bool:
    """Is the unit of an input in question at this row? Near its range only where the model is known
    to be in scale: one that is not is off by a factor anyway."""
    if inputs[k, at.BY] != 0.0 and 0 < counts[k, at.DOUBTED] < LONGEST:
        return True
    least = MARGIN if inputs[k, at.OVERDONE] <= -CLEAR else REACH
    return bool(counts[k, at.DOUBTED] < LONGEST and is_beyond(inputs, counts, k, u, least))


@njit(**HOT)
def weighed(inputs: Any, row: int) -> int:
    """The input that this row says of whether it is in scale; −1: of none."""
    if row % OFTEN != 0 or inputs.shape[0] == 0:
        return -1
    turn = row // OFTEN
    k = turn % inputs.shape[0]
    known = abs(inputs[k, at.OVERDONE]) >= SURE
    return -1 if known and turn // inputs.shape[0] % OFTEN != 0 else int(k)


@njit(**COLD)
def weigh_scale(work: Workspace, dt: float, i: int, row: Any, k: int) -> None:
    """One input of a usual row: would the samples be likelier if it did nothing, as where it
    does less than half of what the model says?"""
    (inputs, _), u, (other, x, y, start) = work.known, work.out.u, work.spare
    most = max(abs(inputs[k, at.LOWEST]), abs(inputs[k, at.HIGHEST]))
    if not abs(u[i, k]) > LIVELY * most:
        return
    measured_before(work, row, start, y)
    for m in range(u.shape[1]):
        other[m] = u[i, m]
    more = 0.0
    for share in (1.0, 0.0):
        other[k] = share * u[i, k]
        code = advance(work, start, other.ctypes.data, dt, x, y)
        if code != 0 or not is_known(x):
            return
        said = surprise(work, row, y, True)
        more += said if share == 1.0 else -said
    inputs[k, at.OVERDONE] = min(max(inputs[k, at.OVERDONE] + more, -DECIDED), DECIDED)


@njit(**COLD)
def likeliest(inputs: Any, k: int, but: int) -> int:
    """The factor that is likeliest of an input, but one; the smallest of several."""
    found = UNITS if but != UNITS else UNITS + 1
    for h in range(found + 1, inputs.shape[1] - at.SCORES):
        if h != but and inputs[k, at.SCORES + h] < inputs[k, at.SCORES + found]:
            found = h
    return found


@njit(**COLD)
def read_as(inputs: Any, k: int, u: float, h: int) -> float:
    """An input as a hypothesis has it."""
    if h >= UNITS:
        return u / float(at.FACTORS[h - UNITS])
    if h == HELD:
        return float(inputs[k, at.WAS])
    value = 0.0 if h == NOTHING else u
    return float(value)


@njit(**COLD)
def foremost(inputs: Any, counts: Any, k: int, u: float) -> float:
    """An input as it is likeliest: as recorded where that is not in question."""
    if not is_asked(inputs, counts, k, u):
        return float(u)
    best = likeliest(inputs, k, -1)
    for h in (NOTHING, RECORDED, HELD):  # in their order where they are alike
        if inputs[k, at.SCORES + h] < inputs[k, at.SCORES + best]:
            best = h
    return float(read_as(inputs, k, u, best))


@njit(**COLD)
def weigh_units(work: Workspace, dt: float, i: int, row: Any) -> None:
    """Scores each hypothesis of the inputs in question by this row, the other inputs as they are
    likeliest so far."""
    (inputs, counts), u, limits = work.known, work.out.u, work.possible
    other, x, y, start = work.spare
    measured_before(work, row, start, y)
    many = 0
    for k in range(u.shape[1]):
        many += is_asked(inputs, counts, k, u[i, k])
    alone = many == 1
    for k in range(u.shape[1]):
        most = inputs.shape[1] - at.SCORES
        if not is_asked(inputs, counts, k, u[i, k]) or (alone and is_decided(inputs, k)):
            continue
        for m in range(u.shape[1]):
            other[m] = foremost(inputs, counts, m, u[i, m])
        least, counted = np.inf, surprise(work, row, y, False)
        for h in range(most):
            score, tried = at.SCORES + h, read_as(inputs, k, u[i, k], h)
            possible = h < UNITS or (
                limits[k, 2 + h - UNITS] > 0 and not is_beyond(inputs, counts, k, tried, ASIDE)
            )
            other[k], lost = tried, CLEAR * counted
            if h == UNKNOWN:
                lost = VAGUE * counted
            elif possible:
                code = advance(work, start, other.ctypes.data, dt, x, y)
                if code == 0 and is_known(x):
                    lost = surprise(work, row, y, True)
            inputs[k, score] += lost
            least = min(least, inputs[k, score])
        for h in range(most):  # what is behind by so much may come back
            score = at.SCORES + h
            inputs[k, score] = min(inputs[k, score] - least, 2.0 * DECIDED)


@njit(**COLD)
def is_decided(inputs: Any, k: int) -> bool:
    """Does nothing come near the factor that an input is divided by?"""
    own = inputs[k, at.BY] == at.FACTORS[likeliest(inputs, k, -1) - UNITS]
    return bool(own and ahead_by(inputs, k) >= DECIDED and ahead(inputs, k, False) >= SURE)


@njit(**COLD)
def ahead_by(inputs: Any, k: int) -> float:
    """How much likelier the likeliest factor is than all else [log]."""
    best = likeliest(inputs, k, -1)
    other = inputs[k, at.SCORES + likeliest(inputs, k, best)]
    return float(min(other - inputs[k, at.SCORES + best], ahead(inputs, k, True)))


@njit(**COLD)
def is_proven(inputs: Any, k: int) -> bool:
    """Has the newest value of an input told for a factor?"""
    return bool(ahead(inputs, k, False) - inputs[k, at.AHEAD] >= CLEAR)


@njit(**COLD)
def ahead(inputs: Any, k: int, far: bool) -> float:
    """How much likelier the likeliest factor is than all that is none [log]; what nobody knows is
    nothing ``far`` outside."""
    scores = at.SCORES
    rest = min(inputs[k, scores], inputs[k, scores + HELD], inputs[k, scores + NOTHING])
    if not far:
        rest = min(rest, inputs[k, scores + UNKNOWN])
    return float(rest - inputs[k, scores + likeliest(inputs, k, -1)])


@njit(**COLD)
def ask(limits: Any, inputs: Any, counts: Any, u: Any, i: int, row: int) -> bool:
    """Opens the question of each input that leaves its range; is one open?"""
    found = False
    for k in range(u.shape[1]):
        if counts[k, at.DOUBTED] == 0:
            inputs[k, at.BY] = inputs[k, at.OVER] = 0.0
        if not is_asked(inputs, counts, k, u[i, k]):
            continue
        found = True
        if counts[k, at.VALUES_OF] == 0 or row - counts[k, at.ASKED] > LONGEST:
            for h in range(at.SCORES, inputs.shape[1]):
                inputs[k, h] = 0.0
            inputs[k, at.WAS], inputs[k, at.LATEST] = inputs[k, at.BELIEVED], u[i, k]
            counts[k, at.VALUES_OF], counts[k, at.OPENED] = 1, row
            counts[k, at.PROVEN_BY], inputs[k, at.AHEAD] = 0, 0.0
            leapt = risen_by(u[i, k], inputs[k, at.BELIEVED], limits[k, 2:])
            lately = row - counts[k, at.ASKED] <= LONGEST
            counts[k, at.LEAPT] = counts[k, at.LEAPT] if lately and leapt == 0 else leapt
            if counts[k, at.LEAPT] > 0:
                nearest = at.FACTORS[counts[k, at.LEAPT] - UNITS]
                for c in range(at.FACTORS.shape[0] - 1):  # a rise tells no two apart so near
                    if limits[k, 2 + c] > 0 and abs(at.FACTORS[c] / nearest - 1.0) <= ALIKE:
                        inputs[k, at.SCORES + UNITS + c] -= SURE
        elif abs(u[i, k] - inputs[k, at.LATEST]) > ALIKE * abs(inputs[k, at.LATEST]):
            inputs[k, at.LATEST] = u[i, k]
            counts[k, at.VALUES_OF] += 1
            counts[k, at.PROVEN_BY] += is_proven(inputs, k)
            inputs[k, at.AHEAD] = max(ahead(inputs, k, False), 0.0)
        counts[k, at.ASKED] = row
    return found


@njit(**COLD)
def name_units(inputs: Any, counts: Any, u: Any, i: int) -> None:
    """The factor that each input in question is divided by from this row on, if by one."""
    for k in range(u.shape[1]):
        if not is_asked(inputs, counts, k, u[i, k]):
            continue
        best, by = likeliest(inputs, k, -1), inputs[k, at.BY]
        far = is_beyond(inputs, counts, k, u[i, k], REACH)
        factor, more = float(at.FACTORS[best - UNITS]), ahead(inputs, k, far)
        least = SURE if counts[k, at.SAID] == 1 else 0.0  # what was told stands for longer
        if by == 0.0:
            proven = counts[k, at.PROVEN_BY] + is_proven(inputs, k)
            sure = more >= SURE and proven > 1
            leapt = counts[k, at.LEAPT] == best and more >= CLEAR
            by = factor if sure or leapt or (far and more > 0.0) else 0.0
        elif not far and more < (-least if least > 0.0 else CLEAR):
            by = 0.0
        elif more > 0.0 and lead_over(inputs, k, by) > least:
            by = factor
        if by != inputs[k, at.BY]:
            inputs[k, at.BY], counts[k, at.SAID] = by, 0


@njit(**COLD)
def lead_over(inputs: Any, k: int, factor: float) -> float:
    """How much likelier the likeliest factor is than this one [log]."""
    best = inputs[k, at.SCORES + likeliest(inputs, k, -1)]
    for c in range(at.FACTORS.shape[0]):
        if at.FACTORS[c] == factor:
            return float(inputs[k, at.SCORES + UNITS + c] - best)
    return 0.0
