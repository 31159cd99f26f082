"""What a number that was tuned alone would be if one that stayed as it was were tuned as well.

That one number explains what changed does not say that it alone changed: a few rows at much the
same speed tell dry friction from viscous friction by their noise. So each number that was left out
is tuned beside those that were let go, and their intervals hold what they are then. One that
moves beyond its interval is weak, and it is said what it would be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from evertwin.signals.spoken import number
from evertwin.tuning import Fit, Problem
from evertwin.tuning.intervals.fit import Amend

Together: TypeAlias = Callable[[tuple[str, ...]], Fit]


def beside(problem: Problem, fit: Fit, left_out: Sequence[str], tune: Together) -> Fit:
    """The fit, whose intervals hold those of its numbers with each of those ``left_out``.

    Args:
        problem: what was tuned: some of the numbers.
        fit: its tuning.
        left_out: numbers that stayed as they were.
        tune: fits the numbers that are named, from the same start.
    """
    whole = fit
    for other in left_out:
        more = tune((*problem.names, other))
        if not more.converged:
            continue
        found = dict[int, Amend]()
        for k, name in enumerate(fit.names):
            if fit.verdict[k] == "not" or name not in more.names:
                continue
            value, (low, high) = _with(more, name, float(fit.start[k]))
            (least, most), unit = whole.interval(name), "" if fit.units[k] == "1" else fit.units[k]
            said = f"{number(value, unit, 3)} (± {(high - low) / 2:.2g}) if {other} changed too"
            within = fit.interval95[k, 0] <= value <= fit.interval95[k, 1]
            word, why = ("", ()) if within else ("weak", (said,))
            found[k] = Amend((min(least, low), max(most, high)), word, why)
        whole = whole.amended(found)
    return whole


def _with(more: Fit, name: str, start: float) -> tuple[float, tuple[float, float]]:
    """Value and interval of a number beside another one. Where the rows tell both no more apart,
    the other may be all that changed: it is as it was."""
    low, high = more.interval(name)
    if more.verdict[more.names.index(name)] == "not" or not np.isfinite([low, high]).all():
        return start, (start, start)
    return more[name], (low, high)
