"""What a tuned window says: the parameters had moved, the form is wrong, or noise hides both."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evertwin.anomaly.verdict import Verdict, branch, explained
from evertwin.correction.improve import Selection
from evertwin.gauges.change import likely, split
from evertwin.gauges.gauge_rows import unchanged
from evertwin.gauges.noise import buried
from evertwin.setup.evaluation import falls_short
from evertwin.setup.setup import Setup
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.recordings import beginning

NEARLY_ALL = 0.9
"""Part of the deviation from which on tuned numbers are tried before another form is looked for."""
NAMED = 6
"""Parameters that are named one by one."""


def partly(names: Sequence[str], editable: Sequence[str]) -> Verdict:
    """Of a tuning of some of the parameters: which, and that the others wait.

    >>> partly(("Fc1", "Fv1"), ("Fc1", "Fv1", "mass")).reason
    'only Fc1, Fv1 were due to be fitted this time; the 1 other keeps its value'
    """
    rest, more = len(editable) - len(names), len(names) - NAMED
    told = ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")
    kept = f"the {rest} others keep their values" if rest > 1 else "the 1 other keeps its value"
    due = "were" if len(names) > 1 else "was"
    return Verdict("normal", "", f"only {told} {due} due to be fitted this time; {kept}")


def judged(setup: Setup, problem: Problem, fit: Fit) -> Verdict:
    """Normal, abnormal or noise, with the cause that explains most; and what a form waits for."""
    found = _judged(setup, problem, fit)
    later = _too_early(setup, problem) if found.kind == "abnormal" else ""
    return replace(found, reason=found.reason + later) if later else found


def _too_early(setup: Setup, problem: Problem) -> str:
    """That a correction is not looked for on so few predictions, and how long that takes."""
    rule, horizon, least = setup.spec.correction, setup.horizon, Selection().least
    if setup.static or rule.translated or not (rule.terms and math.isfinite(horizon)):
        return ""
    with np.errstate(all="ignore"):
        place = likely(unchanged(problem))  # rows before a change are of another machine
    seconds = sum(float(w.dt.sum()) for w in split(problem.windows, place)[1])
    if seconds >= least * horizon:
        return ""
    return (
        f"; a correction is looked for from {least} predictions of {horizon:g} s on, in "
        f"{least * horizon - seconds:.0f} s of such rows"
    )


def _judged(setup: Setup, problem: Problem, fit: Fit) -> Verdict:
    refits = {}
    there, own = problem.model.parameters.names, beginning(problem.model, problem.names)
    for cause, names in setup.causes.items():
        chosen = tuple(name for name in names if name in there)
        if chosen:
            refits[cause] = solve(problem.tuning((*chosen, *own)))
    found = branch(fit, problem, refits, frozenset(setup.editable))
    noisy = buried(setup, problem, fit)
    if noisy and (found.kind == "normal" or found.evidence["dependence"]):
        return replace(found, kind="noise", reason=noisy)
    short = falls_short(setup, problem, fit)
    if found.kind != "normal" or not short:
        return found
    if setup.spec.correction.terms:
        return replace(found, kind="abnormal", reason=f"{short}: the form does not reach it")
    part = explained(fit, fit.noise)
    if found.cause or part >= NEARLY_ALL:  # the window may hold rows of the machine as it was
        evidence = {**found.evidence, "short": part < NEARLY_ALL}
        return replace(found, reason=f"{found.reason}; {short}", evidence=evidence)
    reason = f"{short}, and explains {100 * part:.0f} %: the form does not reach it"
    reason += "" if setup.static else "; [correction] terms names none that may be tried"
    return replace(found, kind="abnormal", reason=reason, alone=True)
