"""Is the machine again as it was when an earlier version was live, as after a repair?

Within a run the first champion predicts beside the live version (`evertwin.trial.recovery`). What
was live in runs before is asked when the live version has become wrong, before anything is tuned;
its trial then tells on rows that nobody has seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from evertwin.fold import Windows
from evertwin.gauges.changes.change import split, swings_alike
from evertwin.gauges.rows.gauge_rows import unchanged
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.models.form import Version
from evertwin.refit.answer_events import event
from evertwin.refit.rows.newest import after
from evertwin.refit.tuner.candidates import Candidates
from evertwin.refit.tuner.tuner import ENOUGH
from evertwin.rows.ring import called
from evertwin.setup.evaluation import scale_of, sizes
from evertwin.setup.task import Task
from evertwin.trial import Recovery
from evertwin.tuning import Problem

ALIKE = 1.2
"""So many times what tuned numbers leave on unseen rows a version that is back leaves at most."""


@unmeasured()
def recovered(work: Candidates, task: Task) -> dict[str, Any] | None:
    """The content of an answer with the former version that is nearest to the machine since it is
    so; None: none is within the requirement, off by half of what the live one is off by, or less,
    and by hardly more than what is tuned to these rows.

    Args:
        work: what poses the problems.
        task: what is asked for.
    """
    if not (task.windows and task.former):
        return None
    names, on = work.editable(task.version), work.setup.watched
    whole = work.problem(task.version, task.windows, names)
    least, found = 1.0 - Recovery().margin, None
    for old in task.former:
        since = _since(work, whole, work.problem(old, task.windows, work.editable(old)))
        for windows in (since, task.windows):
            if not _enough(work, windows, names):
                continue
            rows = sum(len(block.t) for block in windows)
            slack = math.sqrt(max(work.setup.enough / rows, 1.0))  # few rows refute nothing
            left = work.left(old, windows) / work.left(task.version, windows)
            share = float(np.nanmean(left[on]))
            posed = work.problem(old, windows, work.editable(old))
            if share <= least and work.holds(posed, posed.start, slack):
                least, found = share, (old, posed, windows, float(np.nanmean(left)))
    if found is None:
        return None
    old, posed, windows, in_all = found
    past = after((*task.earlier, *task.windows), 0, windows[0].row)
    if past and not swings_alike(past, windows):  # the form may hold for neither
        return None
    now = work.problem(task.version, windows, names)
    if in_all > ALIKE * _tuned(work, task.version, windows, names):
        return None
    was, new = sizes(work.setup, now, now.start), sizes(work.setup, posed, posed.start)
    said = f"the machine is again as at version {old.number}, as after a repair"
    numbers = dict(zip(old.names, old.values, strict=True))
    candidate = work.candidate(old.form, numbers, scale_of(was, new), said, windows)
    told = {"version": old.number, "share": least}
    said += f", since {called(windows[0].row)}"
    return {
        "events": [event("normal", "", said, told)], "candidate": candidate | told,
        "since": windows[0].row,
    }  # fmt: skip


def _since(work: Candidates, live: Problem, old: Problem) -> Windows:
    """The rows from which on an ``old`` version does better than the live one, summed over all."""
    first, second = (np.square(unchanged(one))[:, work.setup.watched] for one in (live, old))
    gain = np.nansum((first - second) / np.nanmean(first, axis=0), axis=1)
    return split(live.windows, 1 + int(np.argmin(np.cumsum(gain))))[1]


def _enough(work: Candidates, windows: Windows, names: Sequence[str]) -> bool:
    """Are these rows enough to tune, and as many predictions as one that comes back is weighed
    on?"""
    rows = sum(len(block.t) for block in windows)
    seconds = sum(float(block.t[-1] - block.t[0]) * 1e-9 for block in windows)
    ahead = work.setup.horizon if not work.setup.static else 0.0
    least = Recovery().segments * ahead if math.isfinite(ahead) else 0.0
    return rows >= ENOUGH * len(names) and seconds >= least


def _tuned(work: Candidates, version: Version, windows: Windows, names: tuple[str, ...]) -> float:
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
