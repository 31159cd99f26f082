"""What few rows told after a change, told anew by many, though what is asked for is met.

The first rows after a change tell what explains them, and a fit as short as that shares it out
among friction's terms by chance. Within the requirement no deviation asks for more, but wear and
plans are read from the numbers. So once a whole window of the changed machine is there, it is
fitted again from what is live: nothing is claimed to have changed, and what the answer finds has
its trial.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.anomaly.verdict import explained
from evertwin.ledger.caveats import in_doubt_of
from evertwin.models.form import Version
from evertwin.refit.numbers.fewest import fewest
from evertwin.refit.numbers.physical import embodied
from evertwin.refit.numbers.simplest import law_now
from evertwin.refit.tuner.candidates import Candidates
from evertwin.rows.ring import called
from evertwin.setup.task import Task
from evertwin.tuning import Fit, Problem
from evertwin.tuning.form.step_length import stepped
from evertwin.tuning.intervals.curvature import unbent
from evertwin.tuning.posing.recordings import beginning


def retold(work: Candidates, task: Task) -> dict[str, Any]:
    """The answer: a candidate, if the rows tell numbers beyond their intervals by more than a trial
    asks for; else nothing.

    Raises:
        TooFew: the rows are too few to tune on.
    """
    version, windows = task.version, task.windows
    names = tuple(n for n in work.editable(version) if n not in work.setup.once)
    if not names or not windows:
        return {"events": []}
    posed, _ = law_now(work.setup, work.problem(version, windows, names), work.tune)
    whole, fit, rounds = embodied(posed, work.tune)
    if rounds or not fit.converged:
        return {"events": []}
    problem, fit = _with_those_tuned(work, task.replaced, version, whole, fit)
    fit = unbent(problem, stepped(problem, fit))
    margin = 1.0 - (1.0 - work.setup.trial.margin) ** 2  # of squares
    if not (_beyond(problem, fit) and explained(fit, fit.noise) >= margin):
        return {"events": []}
    rows = sum(len(block.t) for block in windows)
    said, events = f"told anew by {rows} rows from {called(windows[0].row)} on", list[Any]()
    found = work.tuned(version, problem, fit, windows, events)
    if found is not None:  # what looked the same goes on to do so
        reasons = [found["reason"], said, *in_doubt_of(version.reason)]
        found |= {"reason": "; ".join(dict.fromkeys(reasons))}
    return {"events": events, "fit": fit.to_dict(timing=False), "candidate": found}


def _with_those_tuned(
    work: Candidates, before: Version | None, live: Version, problem: Problem, fit: Fit
) -> tuple[Problem, Fit]:
    """The fewest numbers that tell the rows, beside those that the live version tuned."""
    posed, found = fewest(work.setup, problem, fit, work.tune)
    old = {} if before is None else dict(zip(before.names, before.values, strict=True))
    now = dict(zip(live.names, live.values, strict=True))
    tuned = {name for name in problem.names if name in old and old[name] != now[name]}
    lacking = tuned.difference(posed.names, beginning(problem.model, problem.names))
    if not lacking:
        return posed, found
    more, again, _ = work.tune(
        problem.tuning(tuple(n for n in problem.names if n in posed.names or n in lacking))
    )
    return (more, again) if again.converged else (posed, found)


def _beyond(problem: Problem, fit: Fit) -> bool:
    """Does a number of the machine move beyond its interval?"""
    begins = beginning(problem.model, fit.names)
    half = np.diff(fit.interval95, axis=1)[:, 0] / 2.0
    own = np.array([name not in begins for name in fit.names])
    return bool((np.abs(fit.values - fit.start) > half)[own].any())
