"""What a tuned window says: the parameters had moved, the form is wrong, or noise hides both."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from evertwin.anomaly.verdict import Verdict, branch, explained
from evertwin.correction.search.improve import Selection
from evertwin.gauges.changes.change import likely, split
from evertwin.gauges.changes.noise import buried
from evertwin.gauges.rows.gauge_rows import unchanged
from evertwin.setup.evaluation import falls_short, rms_asked
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.posing.recordings import beginning

NEARLY_ALL = 0.9
"""Part of the deviation from which on tuned numbers are tried before another form is looked for."""
NAMED = 6
"""Parameters that are named one by one."""


def partly(names: Sequence[str], others: Collection[str]) -> Verdict:
    """Of a tuning of some of the parameters: which, and that the ``others`` wait.

    >>> partly(("Fc1", "Fv1"), {"mass"}).reason
    'only Fc1, Fv1 were due to be fitted this time; the 1 other keeps its value'
    """
    rest, more = len(others), len(names) - NAMED
    told = ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")
    kept = f"the {rest} others keep their values" if rest > 1 else "the 1 other keeps its value"
    due = "were" if len(names) > 1 else "was"
    return Verdict("normal", "", f"only {told} {due} due to be fitted this time; {kept}")


def judged(
    setup: Setup, problem: Problem, fit: Fit, rest: Collection[str], *, rounds: bool
) -> Verdict:
    """Normal, abnormal or noise, with the cause that explains most; and what a form waits for.

    Args:
        setup: of the twin.
        problem: what was tuned.
        fit: its tuning.
        rest: numbers that wait for their turn.
        rounds: was it tuned by rounds, as an arm's bodies are?
    """
    if rounds and fit.converged:
        return Verdict("normal", "", f"tuned by rounds: {fit.message}")
    if rest:
        begins = beginning(problem.model, fit.names)
        return partly([name for name in fit.names if name not in begins], rest)
    found = _judged(setup, problem, fit)
    seconds = too_early(setup, problem) if found.kind == "abnormal" else 0.0
    if not seconds:
        return found
    later = (
        f"; a correction is looked for from {Selection().least} predictions of "
        f"{setup.horizon:g} s on, in {seconds:.0f} s of such rows"
    )
    return replace(found, reason=found.reason + later)


def of_the_form(task: Task, verdict: Verdict) -> bool:
    """Is it the form? That looks as if the machine changed where it never held."""
    return verdict.kind == "abnormal" and not verdict.cause and not task.held


def numbers_first(
    setup: Setup, problem: Problem, task: Task, verdict: Verdict, part: float
) -> bool:
    """Are tuned numbers that help, by a part of the deviation, tried before another form is looked
    for? They explain nearly all, or there are too few rows to look for one."""
    if verdict.kind == "abnormal" and too_early(setup, problem):
        return True
    seconds = sum(float(block.t[-1] - block.t[0]) * 1e-9 for block in task.windows)
    ample = of_the_form(task, verdict) and seconds >= Selection().least * setup.horizon
    return part >= NEARLY_ALL and not ample


def too_early(setup: Setup, problem: Problem) -> float:
    """How long a correction is not looked for yet, on so few predictions [s]; 0: it is."""
    rule, horizon = setup.spec.correction, setup.horizon
    if setup.static or rule.translated or not (rule.terms and math.isfinite(horizon)):
        return 0.0
    with np.errstate(all="ignore"):
        place = likely(unchanged(problem))  # rows before a change are of another machine
    seconds = sum(float(w.dt.sum()) for w in split(problem.windows, place)[1])
    return max(Selection().least * horizon - seconds, 0.0)


def _mixed(problem: Problem) -> bool:
    """Do rows of the machine as it was stand out among these?"""
    with np.errstate(all="ignore"):
        return likely(unchanged(problem)) > 0


def _judged(setup: Setup, problem: Problem, fit: Fit) -> Verdict:
    refits = {}
    there, own = problem.model.parameters.names, beginning(problem.model, problem.names)
    for cause, names in setup.causes.items():
        chosen = tuple(name for name in names if name in there)
        if chosen:
            refits[cause] = solve(problem.tuning((*chosen, *own)))
    asked = rms_asked(setup, problem, fit)
    found = branch(fit, problem, refits, frozenset(setup.editable), asked=asked)
    depends: Any = found.evidence["dependence"]
    noisy = buried(setup, problem, fit, depends["share"] if depends else 0.0)
    if noisy:
        found = replace(found, evidence={**found.evidence, "noise": noisy.level.tolist()})
    if noisy and noisy.reason and (found.kind == "normal" or depends):
        return replace(found, kind="noise", reason=noisy.reason)
    short = falls_short(setup, problem, fit, noisy.level if noisy else None)
    if found.kind != "normal":
        return found
    if not short:
        return replace(found, evidence={**found.evidence, "noise": [0.0] * len(fit.outputs)})
    if setup.spec.correction.terms:
        return replace(found, kind="abnormal", reason=f"{short}: the form does not reach it")
    part = explained(fit, fit.noise)
    white = part >= NEARLY_ALL and all(one.white for one in fit.residuals)
    if found.cause or white:  # no form reaches noise
        evidence = {**found.evidence, "short": part < NEARLY_ALL}
        return replace(found, reason=f"{found.reason}; {short}", evidence=evidence)
    reason = f"{short}, and explains {100 * part:.0f} %: the form does not reach it"
    reason += ", or some rows are of the machine as it was" if _mixed(problem) else ""
    reason += "" if setup.static else "; [correction] terms names none that may be tried"
    return replace(found, kind="abnormal", reason=reason, alone=part < NEARLY_ALL)
