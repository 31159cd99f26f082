"""What a number that was tuned alone would be if one that stayed as it was were tuned as well.

That one number explains what changed does not say that it alone changed: a few rows at much the
same speed tell dry friction from viscous friction by their noise. So each number that was left out
is tuned beside those that were let go. Where one of these moves beyond its interval then, the
interval holds what it is with the other as well, and the number is weak.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from evertwin.signals.spoken import number
from evertwin.tuning import Fit, Problem

Together: TypeAlias = Callable[[tuple[str, ...]], Fit]


def beside(problem: Problem, fit: Fit, left_out: Sequence[str], tune: Together, whole: Fit) -> Fit:
    """The fit, whose intervals hold what its numbers are with each of those ``left_out``, and with
    all of them.

    Args:
        problem: what was tuned: some of the numbers.
        fit: its tuning.
        left_out: numbers that stayed as they were.
        tune: fits the numbers that are named, from the same start.
        whole: the fit of all numbers.
    """
    if not left_out:
        return fit
    interval95, verdict, reasons = fit.interval95.copy(), [*fit.verdict], [*fit.reasons]
    others = [(name, tune((*problem.names, name))) for name in left_out]
    others += [(", ".join(left_out), whole)] if len(left_out) > 1 else []
    for other, more in others:
        if not more.converged:
            continue
        for k, name in enumerate(fit.names):
            if fit.verdict[k] == "not" or name not in more.names:
                continue
            value, (low, high) = _with(more, name, float(fit.start[k]))
            first, last = fit.interval95[k].tolist()
            half, moved = (last - first) / 2.0, not first <= value <= last
            if not moved:  # as sure as it is alone, about where it is then
                low, high = max(low, value - half), min(high, value + half)
            interval95[k] = min(interval95[k, 0], low), max(interval95[k, 1], high)
            if not moved:
                continue
            verdict[k] = "weak"
            unit = "" if fit.units[k] == "1" else fit.units[k]
            said = f"{number(value, unit, 3)} (± {(high - low) / 2:.2g}) if {other} changed too"
            reasons[k] = "; ".join(filter(None, (reasons[k], said)))
    return replace(fit, interval95=interval95, verdict=tuple(verdict), reasons=tuple(reasons))


def _with(more: Fit, name: str, start: float) -> tuple[float, tuple[float, float]]:
    """Value and interval of a number beside another one. Where the rows tell both no more apart,
    the other may be all that changed: it is as it was."""
    low, high = more.interval(name)
    if more.verdict[more.names.index(name)] == "not" or not np.isfinite([low, high]).all():
        return start, (start, start)
    return more[name], (low, high)
