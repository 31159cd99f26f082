"""Compiled: is an input of this row believed?

An input outside the range that it had is tried against its last usual value, or divided by the
factor that `evertwin.sync.arbiter.input_unit_loop` finds. Where the outputs are off by far less
with that, they do not follow it. Far outside, that is no machine's doing: the input did not reach
it as it was recorded, and what was tried stands in its place. Nearer, a machine that is blocked
gives such rows too: the input is believed, but it does not widen the range. By a factor it is not:
there the outputs have to follow what was tried. It holds until the outputs follow the input as it
is recorded, by likelihood, since a factor cannot be seen near zero.

See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.fold import Mark
from evertwin.sync import places as at
from evertwin.sync.arbiter.input_unit_loop import (
    ALIKE,
    CLEAR,
    LEVEL,
    LONGEST,
    REACH,
    SURE,
    ahead,
    ahead_by,
    is_beyond,
    likeliest,
)
from evertwin.sync.arbiter.plausible_loop import grown, variance_of
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Finding, Outside
from evertwin.sync.workspace import Workspace

LATE, LONG = 8, 100
"""Rows after which a doubt within that reach is told, and a factor that others come near."""
LATER, VAGUELY = 2, 3
"""Of a doubt that is told at its end, if not before; of one whose unit was not told with it."""
OVER = 8.0
"""Evidence from which a factor is over [log]."""
LARGE, NEARLY = 10.0, 0.07
"""Factor from which on, and how near below it, an input has to fall to where it was, for that to be
over at once."""
TIMES, LONGEST_TIME = 10.0, 1e10
"""Times as long as values came that cannot be they have to stay away, and the most of it [ns]."""
BETTER = 0.1
"""Share of the squared test ratio that remains where the last believed value explains a row."""
ERROR = int(Mark.ERROR)
POSSIBLE, UNNAMED = int(Outside.POSSIBLE), int(Outside.UNNAMED)
FOUND_INPUT, FOUND_SOUND = int(Finding.INPUT), int(Finding.SOUND)


@njit(**COLD)
def is_any_beyond(inputs: Any, counts: Any, u: Any, i: int, widths: float) -> bool:
    """Is an input of the row, whose doubt has not given way? One off by a factor is."""
    for k in range(u.shape[1]):
        if inputs[k, at.BY] != 0.0 and 0 < counts[k, at.DOUBTED] < LONGEST:
            return True
        if counts[k, at.DOUBTED] < LONGEST and is_beyond(inputs, counts, k, u[i, k], widths):
            return True
    return False


@njit(**HOT)
def count(inputs: Any, counts: Any, k: int, value: float, moves: bool) -> None:
    """One more believed value of an input, which is in its range."""
    inputs[k, at.BELIEVED] = value
    if abs(value - inputs[k, at.LEVEL]) > LEVEL * (inputs[k, at.HIGHEST] - inputs[k, at.LOWEST]):
        inputs[k, at.LEVEL] = value
        counts[k, at.CHANGES] += 1
    counts[k, at.SEEN] += 1
    counts[k, at.MOVING] += moves


@njit(**HOT)
def count_usual(inputs: Any, counts: Any, u: Any, i: int, moves: bool) -> bool:
    """Counts a row whose inputs are all in the range that they had, none doubted; else False."""
    for k in range(u.shape[1]):
        value = u[i, k]
        if not inputs[k, at.LOWEST] <= value <= inputs[k, at.HIGHEST] or counts[k, at.DOUBTED] > 0:
            return False
    for k in range(u.shape[1]):
        count(inputs, counts, k, u[i, k], moves)
    return True


@njit(**COLD)
def usual_instead(inputs: Any, counts: Any, u: Any, i: int, other: Any) -> bool:
    """Fills ``other`` with the row's inputs, those outside their range as they usually were.

    Or divided by their factor. Is there one? None of a value that hardly leaves its range.
    """
    found = False
    for k in range(u.shape[1]):
        other[k] = u[i, k]
        if inputs[k, at.BY] != 0.0 and counts[k, at.DOUBTED] < LONGEST:
            other[k] = u[i, k] / inputs[k, at.BY]
            found = True
    for k in range(u.shape[1]):  # beside a factor, what hardly leaves its range is as it is
        widths = REACH if found else 0.0
        if other[k] == u[i, k] and is_beyond(inputs, counts, k, u[i, k], widths):
            other[k] = inputs[k, at.BELIEVED]
    return found


@njit(**COLD)
def is_factor_held(work: Workspace, i: int, row: Any, failed: bool) -> bool:
    """Do the outputs go on to follow an input divided by its factor, rather than as recorded? Of
    one that they do not, ``other`` is as recorded."""
    found, (inputs, counts), u = False, work.known, work.out.u
    (other, _, tried, _), predicted = work.spare, work.case.sample[2]
    for k in range(inputs.shape[0]):
        if inputs[k, at.BY] == 0.0 or not 0 < counts[k, at.DOUBTED] < LONGEST:
            continue
        now = largest_ratio(work, row, tried)
        was = np.inf if failed else largest_ratio(work, row, predicted)
        gate = work.case.settings[1][0, at.GATE]
        most = OVER if was <= 1.0 else CLEAR  # no outlier is just where the other was predicted
        gain = min(max(0.5 * gate * gate * (now - was), -CLEAR), most)
        large = inputs[k, at.BY] >= LARGE  # a small one brings commands to one before by chance
        away = abs(u[i, k] - inputs[k, at.BELIEVED])
        near = away <= (ALIKE if large else NEARLY) * abs(u[i, k]) and (large or was <= now)
        if was <= 1.0 and near and u[i, k] != 0.0:
            gain = OVER  # it fell to where it was all at once, as it had risen
        inputs[k, at.OVER] = max(0.0, inputs[k, at.OVER] + gain)
        neither = min(now, was) > 4.0 and not is_beyond(inputs, counts, k, u[i, k], REACH)
        counts[k, at.NEITHER] = counts[k, at.NEITHER] + 1 if neither else 0
        if inputs[k, at.OVER] >= OVER:
            other[k] = u[i, k]
        elif counts[k, at.NEITHER] >= LATE:
            counts[k, at.DOUBTED], other[k] = LONGEST, u[i, k]
        else:
            found = True
    return found


@njit(**COLD)
def largest_ratio(work: Workspace, row: Any, predicted: Any) -> float:
    """The largest test ratio of the row's samples against a prediction; 0: nothing can be told.

    Args:
        row: members of the groups, what was measured, its marks, row and stamp, phase.
    """
    (limits, rules, _), statistics = work.case.settings, work.case.statistics
    members, measured, marked, now, phase, _ = row
    values, numbers, figures = work.case.memory
    found = 0.0
    for g in range(members.shape[0]):
        growth = grown(rules, numbers, figures, g, now[1])
        for c in range(members.shape[1]):
            j = members[g, c]
            if j < 0:
                break
            base = variance_of(statistics[0], statistics[1], phase, j)
            if marked[j] != 0 or not base * growth > 0 or numbers[g, at.STARTED] == 0:
                continue
            off = measured[j] - predicted[j] - values[j, at.OFFSET]
            nu = wrapped(off, limits[j, at.ANGLE] > 0)
            ratio = nu * nu / (rules[g, at.GATE] * rules[g, at.GATE] * base * growth)
            if np.isfinite(ratio):
                found = max(found, ratio)
            elif measured[j] == measured[j]:
                found = np.inf  # the model breaks down
    return found


@njit(**COLD)
def explains(work: Workspace, row: Any, failed: bool) -> bool:
    """Are the samples off by far less from what was tried than from what was predicted?"""
    was = np.inf if failed else largest_ratio(work, row, work.case.sample[2])
    return bool(was > 1.0 and BETTER * was > largest_ratio(work, row, work.case.expects))


@njit(**COLD)
def note_input(work: Workspace, k: int, kind: int, u: float, now: Any) -> None:
    """Notes that an input is doubted, or believed again."""
    (inputs, counts), (found, detail, extent) = work.known, work.case.notes
    n = extent[0]
    extent[0] = n + 1
    found[n, at.ROW], found[n, at.STAMP] = now
    found[n, at.KIND], found[n, at.GROUP], found[n, at.WHY] = kind, k, 0
    final = now[0] if kind == FOUND_INPUT else counts[k, at.TO]
    found[n, at.FIRST], found[n, at.FINAL] = counts[k, at.DOUBT_ROW], final
    found[n, at.NUMBER] = counts[k, at.DOUBTED]
    detail[n, 0], detail[n, 1], detail[n, 2] = u, inputs[k, at.LOWEST], inputs[k, at.HIGHEST]
    detail[n, 3] = inputs[k, at.BY]


@njit(**COLD)
def doubt(work: Workspace, i: int, now: Any) -> None:
    """The outputs do not follow an input: it is taken as what stands in place, and told."""
    (inputs, counts), u, other = work.known, work.out.u, work.spare[0]
    for k in range(u.shape[1]):
        if other[k] == u[i, k] and (inputs[k, at.BY] == 0.0 or counts[k, at.DOUBTED] == 0):
            continue  # zero divided by an open factor is zero
        if counts[k, at.DOUBTED] == 0:
            opened = inputs[k, at.BY] != 0.0 and counts[k, at.VALUES_OF] > 0
            counts[k, at.DOUBT_ROW] = counts[k, at.OPENED] if opened else now[0]
            counts[k, at.SAID] = 0
        # A machine that follows late follows the old value for a while.
        far, by = is_beyond(inputs, counts, k, u[i, k], REACH), inputs[k, at.BY] != 0.0
        known = by and ahead(inputs, k, False) > -SURE  # it explains what nothing else does
        sure, lasts = counts[k, at.DOUBTED] >= LATE or far, counts[k, at.DOUBTED] >= LONG
        if by:
            vaguely = lasts and counts[k, at.SAID] != VAGUELY
            sure = sure and (vaguely or (known and (lasts or ahead_by(inputs, k) >= CLEAR)))
        if sure and counts[k, at.SAID] != 1:
            counts[k, at.SAID] = VAGUELY if by and not known else 1
            note_input(work, k, FOUND_INPUT, u[i, k], now)
            found, _, extent = work.case.notes
            found[extent[0] - 1, at.WHY] = UNNAMED if by and not known else 0
        elif far and counts[k, at.SAID] == 0:
            counts[k, at.SAID] = LATER
        counts[k, at.DOUBTED] += 1
        counts[k, at.TO] = now[0]
        if known:
            # each row says anew whether the machine follows it divided: that does not give way
            counts[k, at.DOUBTED] = min(counts[k, at.DOUBTED], LONGEST - 1)
        if by and counts[k, at.SAID] == 1:
            inputs[k, at.BELIEVED] = other[k]
        u[i, k], work.out.doubt[i, k] = other[k], ERROR


@njit(**HOT)
def refuse_impossible(work: Workspace, i: int, now: Any) -> None:
    """Inputs beyond what is physically possible did not reach the machine: they stay as they
    were, of a model with a state, once one was believed; else they are not known. What comes again
    soon is believed again once it has stayed away for some times as long."""
    (inputs, counts), u, limits = work.known, work.out.u, work.possible
    keeps = work.case.x.shape[0] > 0
    for k in range(u.shape[1]):
        value = u[i, k]
        if not np.isfinite(value):
            continue
        last, again = inputs[k, at.BEYOND_AT], inputs[k, at.BEYOND_AGAIN] > 0.0
        lately = now[1] - last < min(TIMES * (last - inputs[k, at.BEYOND_FROM]), LONGEST_TIME)
        if limits[k, 0] <= value <= limits[k, 1]:
            if keeps or counts[k, at.DOUBTED] == 0 or not (again and lately):
                continue
        else:
            inputs[k, at.BEYOND_AT] = now[1]
        if counts[k, at.DOUBTED] == 0:
            inputs[k, at.BEYOND_AGAIN] = 1.0 if lately else 0.0
            if not lately:
                inputs[k, at.BEYOND_FROM] = now[1]
            counts[k, at.DOUBT_ROW], counts[k, at.SAID] = now[0], 1
            note_input(work, k, FOUND_INPUT, value, now)
            found, detail, extent = work.case.notes
            n = extent[0] - 1
            found[n, at.WHY], detail[n, 1], detail[n, 2] = POSSIBLE, limits[k, 0], limits[k, 1]
        counts[k, at.DOUBTED] += 1
        counts[k, at.TO] = now[0]
        u[i, k] = inputs[k, at.BELIEVED] if keeps and counts[k, at.SEEN] > 0 else np.nan
        work.out.doubt[i, k] = ERROR


@njit(**COLD)
def believe(work: Workspace, i: int, now: Any, follows: bool, moves: bool) -> None:
    """The row's inputs that are believed: the end of a doubt, and what they widen if followed, and
    if no other unit is likelier."""
    (inputs, counts), u = work.known, work.out.u
    for k in range(u.shape[1]):
        value = u[i, k]
        if work.out.doubt[i, k] == ERROR or not np.isfinite(value):
            continue
        outside = is_beyond(inputs, counts, k, value, 0.0)
        likelier = counts[k, at.VALUES_OF] > 0 and ahead(inputs, k, True) > 0.0
        if not outside or (follows and not likelier):
            first = counts[k, at.SEEN] == 0
            inputs[k, at.LOWEST] = value if first else min(inputs[k, at.LOWEST], value)
            inputs[k, at.HIGHEST] = value if first else max(inputs[k, at.HIGHEST], value)
            inputs[k, at.LEVEL] = value if first else inputs[k, at.LEVEL]
            count(inputs, counts, k, value, moves)
        if counts[k, at.DOUBTED] == 0:
            continue
        if counts[k, at.SAID] == LATER:
            note_input(work, k, FOUND_INPUT, inputs[k, at.LATEST], now)
            work.case.notes[0][work.case.notes[2][0] - 1, at.WHY] = UNNAMED
        if counts[k, at.SAID] > 0:
            note_input(work, k, FOUND_SOUND, value, now)
        told = counts[k, at.SAID] == 1 and inputs[k, at.BY] != 0.0
        counts[k, at.LEAPT] = likeliest(inputs, k, -1) if told else 0  # it may be so again
        counts[k, at.DOUBTED] = counts[k, at.SAID] = counts[k, at.VALUES_OF] = 0
