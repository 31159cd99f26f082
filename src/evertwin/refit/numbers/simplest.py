"""The simplest law that explains a machine that changed: few rows pay for a new term by luck.

A machine that held what is asked has a law. Where new numbers in it reach that again, it keeps the
law: first those that every law has, while the numbers of its terms stay as they were, unless these
pay on held-out parts of the rows; then all of them. Only what they do not reach asks for a term.
"""

from __future__ import annotations

import numpy as np

from evertwin.refit.numbers.fewest import Tune
from evertwin.setup.evaluation import falls_short
from evertwin.setup.friction_law import Chosen, climb_laws, nested, unseen
from evertwin.setup.setup import Setup
from evertwin.tuning import Problem

PAYS = 0.02
"""Least relative fall of the held-out error that counts, as for a rung of the ladder."""


def law_now(setup: Setup, problem: Problem, tune: Tune | None) -> tuple[Problem, Chosen]:
    """What to tune, and the terms that join the law.

    Args:
        setup: says what is asked.
        problem: with all that may be tuned.
        tune: as the candidate will be tuned; None: it has no law yet that held.
    """
    names = () if tune is None else _simplest(setup, problem, tune)
    return (problem.tuning(names), Chosen()) if names else climb_laws(setup, problem)


def _simplest(setup: Setup, problem: Problem, tune: Tune) -> tuple[str, ...]:
    """Numbers that reach what is asked without a new term; empty where none do, or nothing is."""
    choices = nested(setup, problem) if np.isfinite(setup.requirement) else ()
    for k, names in enumerate(choices):
        if k + 1 < len(choices) and not _enough(problem, names, choices[-1]):
            continue
        tuned, fit, _ = tune(problem.tuning(names))
        if fit.converged and not falls_short(setup, tuned, fit):
            return names
    return ()


def _enough(problem: Problem, names: tuple[str, ...], more: tuple[str, ...]) -> bool:
    """Are more numbers no better on unseen rows? Where each try is a search, nothing is tried."""
    if not problem.linear:
        return False
    few, many = (unseen(problem.tuning(some)) for some in (names, more))
    return bool(np.nanmean(many / few) > 1.0 - PAYS)
