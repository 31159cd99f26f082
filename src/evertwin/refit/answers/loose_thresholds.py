"""A form whose thresholds are known badly, because commands come that were not there before.

No fit moves these numbers, for no slope leads to them: the version is off as if its machine were
another one since then. So it is asked first whether they alone, as all rows tell them, are it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from evertwin.correction.numbers.slides import slid_numbers, slides
from evertwin.errors import TooFew
from evertwin.fold import Windows
from evertwin.gauges.changes.change import PART, split
from evertwin.models.form import Version
from evertwin.refit.answer_events import event
from evertwin.refit.tuner.candidates import Candidates
from evertwin.setup.evaluation import scale_of
from evertwin.setup.task import Task
from evertwin.types import Outputs

PARTS = 4
"""Parts of the rows in none of which the version may become worse: with numbers between those of
two machines it would in some."""
LEAVES = 0.5
"""Share of the mean square of an output that is left at most."""


def known_badly(work: Candidates, task: Task) -> dict[str, Any] | None:
    """The answer with the version's form as all rows tell its numbers; None: that is not it."""
    version, setup = task.version, work.setup
    if not (task.windows and slides(version.form)):
        return None
    try:
        q = slid_numbers(
            setup.model, version.form, version.p, task.windows, setup.horizon,
            setup.spec.correction.channels,
        )  # fmt: skip
    except TooFew:
        return None
    found = replace(version, values=tuple(q.tolist()))
    was, now = (_squares(work, one, task.windows) for one in (version, found))
    share = np.nansum(now, axis=0) / np.nansum(was, axis=0)
    if not (np.nanmin(share[setup.watched]) <= LEAVES and np.nanmax(now / was) <= 1.0 + PART):
        return None
    moved = np.flatnonzero(q != version.p)
    names = [version.names[k] for k in moved]
    reason = f"tuned {', '.join(names)}"
    told = {name: [float(version.p[k]), float(q[k])] for name, k in zip(names, moved, strict=True)}
    scale = scale_of(*(np.sqrt(np.nanmean(one, axis=0)) for one in (was, now)))
    values = dict(zip(names, q[moved].tolist(), strict=True))
    return {
        "events": [event("tuned", "", f"{reason}: commands that are new tell more of it", told)],
        "candidate": work.candidate(version.form, values, scale, reason, task.windows),
        "tuned": True,
    }  # fmt: skip


def _squares(work: Candidates, version: Version, windows: Windows) -> Outputs:
    """Mean square of what a version is off by in each part of the rows, (parts, ny)."""
    rest, found = windows, list[Outputs]()
    for k in range(PARTS, 0, -1):
        part, rest = split(rest, sum(len(block.t) for block in rest) // k) if k > 1 else (rest, ())
        found.append(np.square(work.left(version, part)))
    return np.array(found)
