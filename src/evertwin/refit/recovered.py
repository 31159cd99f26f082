"""Is the machine again as it was when an earlier version was live, as after a repair?

Within a run the first champion predicts beside the live version (`evertwin.trial.recovery`). What
was live in runs before is asked when the live version has become wrong, before anything is tuned;
its trial then tells on rows that nobody has seen.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from evertwin.gauges.sensor_change import unmeasured
from evertwin.refit.answering import event
from evertwin.setup.evaluation import scale_of, sizes
from evertwin.setup.task import Task, Windows
from evertwin.trial import Recovery

if TYPE_CHECKING:
    from evertwin.refit.work import Work

ALIKE = 1.2
"""So many times what tuned numbers leave a machine that is as it was leaves at most."""


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
    if not windows:
        return None
    names = work.editable(task.version)
    live, least, found = work.left(task.version, windows), 1.0 - Recovery().margin, None
    for old in task.former:
        posed = work.problem(old, windows, work.editable(old))
        share = float(np.nanmean(work.left(old, windows) / live))
        if share <= least and work.holds(posed, posed.start):
            least, found = share, (old, posed)
    if found is None:
        return None
    old, posed = found
    now = work.problem(task.version, windows, names)
    fit = work.tune(now)[1]
    own = dict(zip(fit.names, fit.values.tolist(), strict=True))
    values = zip(task.version.names, task.version.values, strict=True)
    fitted = replace(task.version, values=tuple(own.get(name, value) for name, value in values))
    if least > ALIKE * float(np.nanmean(work.left(fitted, windows) / live)):
        return None
    before, after = sizes(work.setup, now, now.start), sizes(work.setup, posed, posed.start)
    said = f"the machine is again as at version {old.number}, as after a repair"
    numbers = dict(zip(old.names, old.values, strict=True))
    candidate = work.candidate(old.form, numbers, scale_of(before, after), said, windows)
    told = {"version": old.number, "share": least}
    return {"events": [*events, event("normal", "", said, told)], "candidate": candidate | told}
