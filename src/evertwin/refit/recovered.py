"""Is the machine again as it was when an earlier version was live, as after a repair?

Within a run the first champion predicts beside the live version (`evertwin.trial.recovery`). What
was live in runs before is asked when the live version has become wrong, before anything is tuned;
its trial then tells on rows that nobody has seen.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from evertwin.gauges.change import split
from evertwin.gauges.sensor_change import unmeasured
from evertwin.models.form import Version
from evertwin.refit.answering import event
from evertwin.setup.evaluation import scale_of, sizes
from evertwin.setup.task import Task, Windows
from evertwin.trial import Recovery

if TYPE_CHECKING:
    from evertwin.refit.work import Work

ALIKE = 1.2
"""So many times what tuned numbers leave on unseen rows a version that is back leaves at most."""


@unmeasured()
def recovered(
    work: Work, task: Task, windows: Windows, events: list[dict[str, Any]]
) -> dict[str, Any] | None:
    """The content of an answer with the former version that is nearest to the machine; None: none
    is within the requirement, off by half of what the live one is off by, or less, and by hardly
    more than what is tuned to these rows.

    Args:
        work: what poses the problems.
        task: what is asked for.
        windows: the rows of the machine as it is now.
        events: what the answer says so far.
    """
    if not (windows and task.former):
        return None
    names = work.editable(task.version)
    live, least, found = work.left(task.version, windows), 1.0 - Recovery().margin, None
    rows = sum(len(block.t) for block in windows)
    slack = math.sqrt(max(work.setup.enough / rows, 1.0))  # few rows refute nothing
    for old in task.former:
        posed = work.problem(old, windows, work.editable(old))
        share = float(np.nanmean(work.left(old, windows) / live))
        if share <= least and work.holds(posed, posed.start, slack):
            least, found = share, (old, posed)
    if found is None:
        return None
    old, posed = found
    now = work.problem(task.version, windows, names)
    if least > ALIKE * _tuned(work, task.version, windows, names):
        return None
    before, after = sizes(work.setup, now, now.start), sizes(work.setup, posed, posed.start)
    said = f"the machine is again as at version {old.number}, as after a repair"
    numbers = dict(zip(old.names, old.values, strict=True))
    candidate = work.candidate(old.form, numbers, scale_of(before, after), said, windows)
    told = {"version": old.number, "share": least}
    return {"events": [*events, event("normal", "", said, told)], "candidate": candidate | told}


def _tuned(work: Work, version: Version, windows: Windows, names: tuple[str, ...]) -> float:
    """What numbers tuned to one half of the rows leave on the other half, mean over the outputs:
    on few rows they leave next to nothing of those that they are tuned to."""
    halves, left = split(windows, sum(len(block.t) for block in windows) // 2), list[float]()
    for learned, unseen in (halves, halves[::-1]):
        fit = work.tune(work.problem(version, learned, names))[1]
        own = dict(zip(fit.names, fit.values.tolist(), strict=True))
        values = zip(version.names, version.values, strict=True)
        fitted = replace(version, values=tuple(own.get(name, value) for name, value in values))
        left.append(float(np.nanmean(work.left(fitted, unseen) / work.left(version, unseen))))
    return float(np.mean(left))
