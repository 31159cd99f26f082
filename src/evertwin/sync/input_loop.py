"""Compiled: is an input of this row believed?

An input outside the range that it had is tried against its last usual value, or divided by the
factor that it went up by all at once, if it is one of change of units. Where the outputs are off by
far less with that, they do not follow it. Far outside, that is no machine's doing: the input did
not reach it as it was recorded, and what was tried stands in its place. Nearer, a machine that is
blocked gives such rows too: the input is believed, but it does not widen the range. By a factor it
is not: there the outputs have to follow what was tried. It holds until the outputs follow the input
as it is recorded, by likelihood, since a factor cannot be seen near zero.

See `evertwin.sync.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.fold import Mark
from evertwin.sync import places as at
from evertwin.sync.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Finding
from evertwin.sync.plausible_loop import grown, variance_of

REACH = 10.0
"""Widths of its range by which an input is outside it that no machine was meant to follow."""
MARGIN = 0.1
"""Widths of its range by which an input leaves it at least, where it is in another unit."""
LONGEST = 1000
"""Rows after which a doubt gives way: what lasts may be the machine's as well."""
CLEAR, SURE = 4.0, 8.0
"""The most that a row may say about a factor, and the evidence from which one is over [log]."""
ALIKE = 0.15
"""How near to a factor an input has to rise all at once: it may have moved by itself as well."""
LATE = 8
"""Rows after which a factor within that reach is told."""
ENOUGH = 100
"""Believed rows from which the range is known."""
LEVELS = 10
"""Changes that it takes, too: of a command in steps, few rows are few values."""
APART = 30.0
"""Widths by which a value is outside the range of fewer: a step to ten times the last is not."""
BETTER = 0.1
"""Share of the squared test ratio that remains where the last believed value explains a row."""
ERROR = int(Mark.ERROR)
FOUND_INPUT, FOUND_SOUND = int(Finding.INPUT), int(Finding.SOUND)


@njit(**HOT)
def is_beyond(inputs: Any, counts: Any, k: int, u: float, widths: float) -> bool:
    """Is a value outside the known range of its input, by more than so many widths of it?"""
    low, high = inputs[k, at.LOWEST], inputs[k, at.HIGHEST]
    if counts[k, at.SEEN] < ENOUGH or not high > low:
        return False
    away = (widths if counts[k, at.CHANGES] >= LEVELS else max(widths, APART)) * (high - low)
    return bool(u > high + away or u < low - away)


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
def count_usual(inputs: Any, counts: Any, u: Any, i: int) -> bool:
    """Counts a row whose inputs are all in the range that they had, none doubted; else False."""
    for k in range(u.shape[1]):
        value = u[i, k]
        if not inputs[k, at.LOWEST] <= value <= inputs[k, at.HIGHEST] or counts[k, at.DOUBTED] > 0:
            return False
    for k in range(u.shape[1]):
        counts[k, at.CHANGES] += u[i, k] != inputs[k, at.BELIEVED]
        inputs[k, at.BELIEVED] = u[i, k]
        counts[k, at.SEEN] += 1
    return True


@njit(**COLD)
def risen_by(value: float, before: float, divides: Any) -> float:
    """The nearest factor of a change of units between a value and the one before; 0: none.

    Args:
        divides: of each factor, whether it is one of this input's units.
    """
    found, least = 0.0, ALIKE
    if before != 0.0:
        for c in range(at.FACTORS.shape[0] - 1):
            away = abs(value / before / at.FACTORS[c] - 1.0)
            if away <= least and divides[c] > 0:
                found, least = float(at.FACTORS[c]), away
    return found


@njit(**COLD)
def usual_instead(
    limits: Any, inputs: Any, counts: Any, u: Any, i: int, other: Any
) -> bool:  # fmt: skip
    """Fills ``other`` with the row's inputs, those outside their range as they usually were.

    Or divided by their factor. Is there one? None of a value that hardly leaves its range.
    """
    found = False
    for k in range(u.shape[1]):
        other[k] = u[i, k]
        if counts[k, at.DOUBTED] == 0:
            inputs[k, at.BY] = inputs[k, at.OVER] = 0.0
            if is_beyond(inputs, counts, k, u[i, k], MARGIN):
                inputs[k, at.BY] = risen_by(u[i, k], inputs[k, at.BELIEVED], limits[k, 2:])
        if inputs[k, at.BY] != 0.0 and counts[k, at.DOUBTED] < LONGEST:
            other[k] = u[i, k] / inputs[k, at.BY]
            found = True
        elif is_beyond(inputs, counts, k, u[i, k], 0.0):
            other[k] = inputs[k, at.BELIEVED]
    return found


@njit(**COLD)
def is_factor_held(
    settings: Any, memory: Any, statistics: Any, known: Any, u: Any, i: int, row: Any, tried: Any,
    predicted: Any, failed: bool,
) -> bool:  # fmt: skip
    """Do the outputs go on to follow an input divided by its factor, rather than as recorded?"""
    held, (inputs, counts) = False, known
    for k in range(inputs.shape[0]):
        if inputs[k, at.BY] == 0.0 or not 0 < counts[k, at.DOUBTED] < LONGEST:
            continue
        now = largest_ratio(settings, memory, statistics, row, tried)
        was = np.inf if failed else largest_ratio(settings, memory, statistics, row, predicted)
        gate = settings[1][0, at.GATE]
        gain = min(max(0.5 * gate * gate * (now - was), -CLEAR), CLEAR)
        near = abs(u[i, k] - inputs[k, at.BELIEVED]) <= ALIKE * abs(u[i, k])
        if was <= 1.0 and near and u[i, k] != 0.0:
            gain = SURE  # it fell to where it was all at once, as it had risen
        inputs[k, at.OVER] = max(0.0, inputs[k, at.OVER] + gain)
        held = inputs[k, at.OVER] < SURE
        if held and min(now, was) > 4.0:
            counts[k, at.DOUBTED] = LONGEST  # the machine follows neither
            held = False
    return held


@njit(**COLD)
def largest_ratio(settings: Any, memory: Any, statistics: Any, row: Any, predicted: Any) -> float:
    """The largest test ratio of the row's samples against a prediction; 0: nothing can be told.

    Args:
        row: members of the groups, what was measured, its marks, row and stamp, phase.
    """
    limits, rules, _ = settings
    members, measured, marked, now, phase = row
    values, numbers, figures = memory
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
def explains(
    settings: Any, memory: Any, statistics: Any, row: Any, tried: Any, predicted: Any, failed: bool
) -> bool:
    """Are the samples off by far less from what was tried than from what was predicted?"""
    was = np.inf if failed else largest_ratio(settings, memory, statistics, row, predicted)
    return bool(
        was > 1.0 and BETTER * was > largest_ratio(settings, memory, statistics, row, tried)
    )


@njit(**COLD)
def note_input(inputs: Any, counts: Any, notes: Any, k: int, kind: int, u: float, now: Any) -> None:
    """Notes that an input is doubted, or believed again."""
    found, detail, extent = notes
    n = extent[0]
    extent[0] = n + 1
    found[n, at.ROW], found[n, at.STAMP] = now
    found[n, at.KIND], found[n, at.GROUP], found[n, at.WHY] = kind, k, 0
    found[n, at.FIRST], found[n, at.FINAL] = counts[k, at.DOUBT_ROW], counts[k, at.TO]
    found[n, at.NUMBER] = counts[k, at.DOUBTED]
    detail[n, 0], detail[n, 1], detail[n, 2] = u, inputs[k, at.LOWEST], inputs[k, at.HIGHEST]
    detail[n, 3] = inputs[k, at.BY]


@njit(**COLD)
def doubt(
    inputs: Any, counts: Any, notes: Any, u: Any, doubts: Any, i: int, now: Any, other: Any
) -> None:  # fmt: skip
    """The outputs do not follow an input: it is taken as ``other`` says, and told."""
    for k in range(u.shape[1]):
        if other[k] == u[i, k] and (inputs[k, at.BY] == 0.0 or counts[k, at.DOUBTED] == 0):
            continue  # zero divided by an open factor is zero
        if counts[k, at.DOUBTED] == 0:
            counts[k, at.DOUBT_ROW], counts[k, at.SAID] = now[0], 0
        # A machine that follows late follows the old value for a while.
        sure = counts[k, at.DOUBTED] >= LATE or is_beyond(inputs, counts, k, u[i, k], REACH)
        if sure and counts[k, at.SAID] == 0:
            counts[k, at.SAID] = 1
            note_input(inputs, counts, notes, k, FOUND_INPUT, u[i, k], now)
        counts[k, at.DOUBTED] += 1
        counts[k, at.TO] = now[0]
        if inputs[k, at.BY] != 0.0:
            # each row says anew whether the machine follows it divided: that does not give way
            counts[k, at.DOUBTED] = min(counts[k, at.DOUBTED], LONGEST - 1)
            inputs[k, at.BELIEVED] = other[k]
        u[i, k], doubts[i, k] = other[k], ERROR


@njit(**HOT)
def refuse_impossible(
    limits: Any, inputs: Any, counts: Any, notes: Any, u: Any, doubts: Any, i: int, now: Any,
    keeps: bool,
) -> None:  # fmt: skip
    """Inputs beyond what is physically possible did not reach the machine: they stay as they were
    (``keeps``, once one was believed), or are not known."""
    for k in range(u.shape[1]):
        value = u[i, k]
        if limits[k, 0] <= value <= limits[k, 1] or not np.isfinite(value):
            continue
        if counts[k, at.DOUBTED] == 0:
            counts[k, at.DOUBT_ROW], counts[k, at.SAID] = now[0], 1
            note_input(inputs, counts, notes, k, FOUND_INPUT, value, now)
            found, detail, extent = notes
            n = extent[0] - 1
            found[n, at.WHY], detail[n, 1], detail[n, 2] = 1, limits[k, 0], limits[k, 1]
        counts[k, at.DOUBTED] += 1
        counts[k, at.TO] = now[0]
        u[i, k] = inputs[k, at.BELIEVED] if keeps and counts[k, at.SEEN] > 0 else np.nan
        doubts[i, k] = ERROR


@njit(**COLD)
def believe(
    inputs: Any, counts: Any, notes: Any, u: Any, doubts: Any, i: int, now: Any, follows: bool
) -> None:  # fmt: skip
    """The row's inputs that are believed: the end of a doubt, and what they widen if followed."""
    for k in range(u.shape[1]):
        value = u[i, k]
        if doubts[i, k] == ERROR or not np.isfinite(value):
            continue
        if follows or not is_beyond(inputs, counts, k, value, 0.0):
            first = counts[k, at.SEEN] == 0
            counts[k, at.CHANGES] += not first and value != inputs[k, at.BELIEVED]
            inputs[k, at.BELIEVED] = value
            inputs[k, at.LOWEST] = value if first else min(inputs[k, at.LOWEST], value)
            inputs[k, at.HIGHEST] = value if first else max(inputs[k, at.HIGHEST], value)
            counts[k, at.SEEN] += 1
        if counts[k, at.DOUBTED] > 0 and counts[k, at.SAID] == 1:
            note_input(inputs, counts, notes, k, FOUND_SOUND, value, now)
        counts[k, at.DOUBTED] = 0
