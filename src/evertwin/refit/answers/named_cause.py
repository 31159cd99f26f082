"""A cause that a person named is tried first: its numbers alone, and what is left is looked at.

It is adopted where it explains half of the deviation or more and nothing asked for is missed then;
else an event says what it explains, and all that may be tuned is tuned as if nobody had said so.
"""

from __future__ import annotations

from typing import Any

from evertwin.anomaly.verdict import explained
from evertwin.errors import UsageError
from evertwin.refit.answer_events import event
from evertwin.refit.tuner.candidates import Candidates
from evertwin.setup.evaluation import falls_short
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task
from evertwin.tuning import Problem
from evertwin.tuning.posing.recordings import beginning

ENOUGH = 0.5
"""Share of the deviation that a named cause explains at least."""


def tunable(setup: Setup, cause: str) -> tuple[str, ...]:
    """The numbers of a cause that may be tuned.

    Raises:
        UsageError: there is no such cause, or none of its numbers may be.
    """
    if cause not in setup.causes:
        known = ", ".join(setup.causes) or (
            "none: name some in [tuning.causes], or say true: then it is the machine"
        )
        raise UsageError(f"no cause {cause!r}: there are {known}")
    found = tuple(name for name in setup.causes[cause] if name in setup.editable)
    if not found:
        numbers = ", ".join(setup.causes[cause])
        raise UsageError(
            f"cause {cause}: {numbers} may not be tuned: name them in [tuning] editable"
        )
    return found


def named_first(
    work: Candidates, task: Task, posed: Problem, events: list[dict[str, Any]]
) -> dict[str, Any] | None:
    """The answer where the cause that was named is the one; None: there is none, or it is not.

    Args:
        work: what tunes.
        task: what is asked for.
        posed: the problem on the rows that count, of all that may be tuned.
        events: what the answer says so far; what becomes of the cause is added.
    """
    if not task.cause:
        return None
    there = posed.model.parameters.names
    try:
        names = tuple(name for name in tunable(work.setup, task.cause) if name in there)
    except UsageError as error:  # the twin file is another one since it was named
        events.append(event("heeded", task.cause, f"{error}: all is tuned", {"cause": task.cause}))
        return None
    problem, fit, rounds = work.tune(posed.tuning((*names, *beginning(posed.model, posed.names))))
    part, short = explained(fit, fit.noise), falls_short(work.setup, problem, fit)
    said = f"{task.cause}, which was named, explains {100 * part:.0f} % of the deviation"
    evidence = {"cause": task.cause, "explained": part, "at_bound": fit.at_bound}
    missed = short or ("it would have to leave its bounds" if fit.at_bound else "")
    if not fit.converged or missed or part < ENOUGH:
        why = f" ({missed})" if missed else ""
        events.append(event("heeded", task.cause, f"{said}{why}: all is tuned", evidence))
        return None
    events.append(event("normal", task.cause, said, evidence))
    return {
        "events": events, "fit": fit.to_dict(timing=False), "tuned": True, **rounds,
        "candidate": work.tuned(task.version, problem, fit, problem.windows, events),
    }  # fmt: skip
