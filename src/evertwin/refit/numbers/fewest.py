"""The fewest numbers that explain what changed: what the rows do not tell stays as it was.

Rows at one operating point are explained by many numbers at once, each of them far from what it
was, and elsewhere none of that holds. A machine that held, and changed, most likely changed in one
number. So numbers are let go one after the other, the one that explains most first, and of several
that explain as much the one that has to change least, until they leave about what all do. Of many,
those that act on outputs alone which are as they were, such as friction of other joints, stay.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from evertwin.gauges.rows.gauge_rows import residual
from evertwin.refit.numbers.companions import beside
from evertwin.refit.numbers.physical import PASSIVE
from evertwin.setup.evaluation import falls_short
from evertwin.setup.setup import Setup
from evertwin.signals.sizes import mean_square, rms
from evertwin.signals.units import compatible
from evertwin.tuning import Fit, Problem
from evertwin.tuning.posing.recordings import beginning
from evertwin.types import Vector

Tune: TypeAlias = Callable[[Problem], tuple[Problem, Fit, dict[str, Any]]]
MANY = 4
"""Numbers up to which each is tried alone: with more the answer comes late, a fit for each."""
EITHER = 2.0
"""So many times as far a number that may lie below zero moves: a bias is rarer than wear."""
PART, MOSTLY = 0.25, 0.5
"""Part of the square that is asked, and of it what a fit leaves of an output that changed."""
LITTLE = 0.05
"""Share of what is explained that counts as nothing: what all else leaves is the same for all."""


def fewest(setup: Setup, problem: Problem, fit: Fit, tune: Tune) -> tuple[Problem, Fit]:
    """What was tuned, and the fit, with as few of the numbers as explain the rows.

    Args:
        setup: says what is asked.
        problem: tuned, on the rows since the machine changed; it starts where it held.
        fit: of all its numbers.
        tune: as the candidate is tuned.
    """
    begins = beginning(problem.model, problem.names)
    names = tuple(name for name in problem.names if name not in begins)
    if len(names) > MANY and fit.converged:
        problem, fit = _of_what_changed(setup, problem, fit, tune)
        names = tuple(name for name in problem.names if name not in begins)
    if not (1 < len(names) <= MANY and fit.converged):
        return problem, fit
    used, start = problem.rows.used, residual(problem, problem.start)
    size = rms(start, 0.0)
    size = np.where(size > 0.0, size, 1.0)

    def off(one: Problem, values: Vector) -> float:
        left = np.where(used, one.residuals(values), np.nan) / size
        return float(np.nansum(np.square(left)))

    whole, before = off(problem, fit.values), off(problem, problem.start)
    if not whole < before:  # all of them tell nothing
        return problem, fit
    posed, found = _chosen(setup, problem, fit, tune, (off, whole, before))
    left_out = tuple(name for name in names if name not in posed.names)
    return posed, beside(posed, found, left_out, lambda one: tune(problem.tuning(one))[1])


def _chosen(
    setup: Setup, problem: Problem, fit: Fit, tune: Tune,
    judged: tuple[Callable[[Problem, Vector], float], float, float],
) -> tuple[Problem, Fit]:  # fmt: skip
    """What of the problem's numbers is let go. ``judged``: what a fit is off by, with all of them,
    and with none."""
    off, whole, before = judged
    begins = beginning(problem.model, problem.names)
    names = tuple(name for name in problem.names if name not in begins)
    enough = whole + LITTLE * (before - whole)
    reached = not falls_short(setup, problem, fit)
    chosen = tuple[str, ...]()
    while len(chosen) < len(names) - 1:
        tried = list[tuple[float, float, str, Problem, Fit]]()
        for name in names:
            if name in chosen:
                continue
            posed, found, _ = tune(problem.tuning((*chosen, name, *begins)))
            if found.converged and name in found.names and not found.at_bound:
                left = off(posed, found.values)
                if left < before:  # else it explains nothing
                    tried.append((left, _moved(problem, found, name), name, posed, found))
        if not tried:
            break
        least = min(left for left, *_ in tried)
        alike = max(enough, least + LITTLE * (before - least))
        left, _, name, posed, found = min(
            (one for one in tried if one[0] <= alike), key=lambda one: one[1]
        )
        chosen = (*chosen, name)
        if left <= enough and not (reached and falls_short(setup, posed, found)):
            return posed, found
    return problem, fit


def _of_what_changed(setup: Setup, problem: Problem, fit: Fit, tune: Tune) -> tuple[Problem, Fit]:
    """Tuned without the numbers that act on no output which is off by more than is asked, or by
    half as much and mostly so by what is tuned: the second joint that wears is not told later."""
    start = np.where(problem.rows.used, residual(problem, problem.start), np.nan)
    slack = max(setup.enough / len(start), 1.0)  # few rows tell less of how far off an output is
    limit = slack * np.square(setup.requirement * setup.sizes(problem.rows.y))
    off, left = (mean_square(one, 0.0) for one in (start, np.where(
        problem.rows.used, residual(problem, fit.values), np.nan)))  # fmt: skip
    changed = (off > limit) | ((off > PART * limit) & (left < MOSTLY * off))
    acts = np.asarray(problem.sensitivity(fit.values).acts[changed].any(axis=0))
    if not acts.any() or acts.all():
        return problem, fit
    kept = tuple(name for name, on in zip(problem.names, acts, strict=True) if on)
    posed, found, _ = tune(problem.tuning(kept))
    return (posed, found) if found.converged else (problem, fit)


def _moved(problem: Problem, fit: Fit, name: str) -> float:
    """How far a number moves: of one that is above zero by how many times, as a logarithm; else of
    the largest of its unit, such as an offset of the friction beside it."""
    item, value = problem.parameters[name], fit[name]
    start = float(problem.start[problem.names.index(name)])
    if item.resists or (start > 0.0 and any(compatible(item.unit, one) for one in PASSIVE)):
        return abs(math.log(value / start)) if min(value, start) > 0.0 else math.inf
    alike = [
        abs(float(one))
        for other, one in zip(problem.names, problem.start, strict=True)
        if problem.parameters[other].unit == item.unit
    ]
    return EITHER * abs(value - start) / max(*alike, 1e-12 * abs(value), 1e-300)
