"""Normal or abnormal: the verdict on a fit, by the causes and the requirement of a twin file."""

from __future__ import annotations

from dataclasses import replace

from evertwin.anomaly.verdict import Verdict, branch
from evertwin.loop.evaluation import falls_short
from evertwin.loop.setup import Setup
from evertwin.tuning import Fit, Problem, solve


def judged(setup: Setup, problem: Problem, fit: Fit) -> Verdict:
    """Normal or abnormal, with the cause that explains most."""
    refits = {}
    there = problem.model.parameters.names
    for cause, names in setup.causes.items():
        chosen = tuple(name for name in names if name in there)
        if chosen:
            refits[cause] = solve(problem.tuning(chosen))
    found = branch(fit, problem, refits, frozenset(setup.editable))
    short = falls_short(setup, problem, fit)
    if found.kind == "normal" and short and setup.spec.correction.terms:
        return replace(found, kind="abnormal", reason=f"{short}: the form does not reach it")
    return found
