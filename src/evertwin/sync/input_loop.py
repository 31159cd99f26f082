"""Compiled: is an input of this row believed?

An input far outside the range that it had until now is tried against its last believed value. Where
the outputs are off by far less with that, they do not follow it: it did not reach the machine as it
was recorded, and the last believed value stands in its place. Where they follow, or tell nothing of
it, it is believed and widens the range.

See `evertwin.sync.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.sync import places as at
from evertwin.sync.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.plausible_loop import grown, variance_of

REACH = 1.0
"""Widths of its range that an input is outside it to be tried."""
ENOUGH = 100
"""Believed rows from which the range is known."""
BETTER = 0.1
"""Share of the squared test ratio that remains where the last believed value explains a row."""
ERROR = 6
FOUND_INPUT, FOUND_SOUND = 6, 7


@njit(**HOT)
def is_far(inputs: Any, counts: Any, k: int, u: float) -> bool:
    """Is a value far outside the range that the input had?"""
    low, high = inputs[k, at.LOWEST], inputs[k, at.HIGHEST]
    reach = REACH * (high - low)
    if counts[k, at.SEEN] < ENOUGH or not reach > 0:
        return False
    return bool(u > high + reach or u < low - reach)


@njit(**HOT)
def is_usual(inputs: Any, counts: Any, u: Any, i: int) -> bool:
    """Are all inputs of the row in the range that they had, none doubted? Then they count."""
    for k in range(u.shape[1]):
        value = u[i, k]
        if not inputs[k, at.LOWEST] <= value <= inputs[k, at.HIGHEST] or counts[k, at.DOUBTED] > 0:
            return False
    for k in range(u.shape[1]):
        inputs[k, at.BELIEVED] = u[i, k]
        counts[k, at.SEEN] += 1
    return True


@njit(**HOT)
def is_any_far(inputs: Any, counts: Any, u: Any, i: int) -> bool:
    """Is there an input to be tried?"""
    for k in range(u.shape[1]):  # noqa: SIM110 - generators do not compile
        if is_far(inputs, counts, k, u[i, k]):
            return True
    return False


@njit(**COLD)
def instead(inputs: Any, counts: Any, u: Any, i: int, other: Any) -> None:
    """Fills ``other`` with the row's inputs, those far outside as they were believed last."""
    for k in range(u.shape[1]):
        far = is_far(inputs, counts, k, u[i, k])
        other[k] = inputs[k, at.BELIEVED] if far else u[i, k]


@njit(**COLD)
def worst(settings: Any, memory: Any, statistics: Any, row: Any, predicted: Any) -> float:
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
    was = np.inf if failed else worst(settings, memory, statistics, row, predicted)
    return bool(was > 1.0 and BETTER * was > worst(settings, memory, statistics, row, tried))


@njit(**COLD)
def tell(inputs: Any, counts: Any, notes: Any, k: int, kind: int, u: float, now: Any) -> None:
    """Notes that an input is doubted, or believed again."""
    found, detail, extent = notes
    n = extent[0]
    extent[0] = n + 1
    found[n, at.ROW], found[n, at.STAMP] = now
    found[n, at.KIND], found[n, at.GROUP], found[n, at.WHY] = kind, k, 0
    found[n, at.FIRST], found[n, at.FINAL] = counts[k, at.SINCE], counts[k, at.TO]
    found[n, at.NUMBER] = counts[k, at.DOUBTED]
    detail[n, 0], detail[n, 1], detail[n, 2] = u, inputs[k, at.LOWEST], inputs[k, at.HIGHEST]


@njit(**COLD)
def doubt(inputs: Any, counts: Any, notes: Any, u: Any, doubts: Any, i: int, now: Any) -> None:
    """The outputs do not follow what is far outside: taken as it was believed last, and told."""
    for k in range(u.shape[1]):
        if not is_far(inputs, counts, k, u[i, k]):
            continue
        if counts[k, at.DOUBTED] == 0:
            counts[k, at.SINCE] = now[0]
            tell(inputs, counts, notes, k, FOUND_INPUT, u[i, k], now)
        counts[k, at.DOUBTED] += 1
        counts[k, at.TO] = now[0]
        u[i, k], doubts[i, k] = inputs[k, at.BELIEVED], ERROR


@njit(**COLD)
def believe(inputs: Any, counts: Any, notes: Any, u: Any, doubts: Any, i: int, now: Any) -> None:
    """The row's inputs that are believed: their range, and the end of a doubt."""
    for k in range(u.shape[1]):
        value = u[i, k]
        if doubts[i, k] == ERROR or not np.isfinite(value):
            continue
        first = counts[k, at.SEEN] == 0
        inputs[k, at.BELIEVED] = value
        inputs[k, at.LOWEST] = value if first else min(inputs[k, at.LOWEST], value)
        inputs[k, at.HIGHEST] = value if first else max(inputs[k, at.HIGHEST], value)
        counts[k, at.SEEN] += 1
        if counts[k, at.DOUBTED] > 0:
            tell(inputs, counts, notes, k, FOUND_SOUND, value, now)
            counts[k, at.DOUBTED] = 0
