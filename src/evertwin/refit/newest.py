"""The machine as it is now, where it goes on changing: a fit to all rows is of a machine that was.

Of the rows that tell the change, the newest quarter is predicted by a fit to all rows before it and
by one to the quarter before it. Where the latter is clearly the better one, the older half is left
out, and the question is asked again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from evertwin.errors import DataError, ModelError
from evertwin.gauges.change import split
from evertwin.setup.task import Windows
from evertwin.tuning import Fit, Problem

CLEARLY = 0.3
"""Share of the squared deviation that newer rows take away at least."""
ENOUGH = 30
"""Rows a parameter that a fit needs."""
Pose: TypeAlias = Callable[[Windows], Problem]
Tune: TypeAlias = Callable[[Problem], tuple[Problem, Fit, dict[str, Any]]]


def newest(problem: Problem, fit: Fit, pose: Pose, tune: Tune) -> tuple[Problem, Fit]:
    """What was tuned, and the fit, on the newest rows if these tell another machine than all do.

    Args:
        problem: tuned, on the rows since the machine changed.
        fit: to these rows.
        pose: the same problem on some of them.
        tune: as the candidate is tuned.
    """
    try:
        while (rows := _half(problem.windows, len(fit.names))) and _better(rows, pose, tune):
            problem, fit, _ = tune(pose(rows[1]))
    except (DataError, ModelError):  # too few rows, or none that tell
        pass
    return problem, fit


def _half(windows: Windows, names: int) -> tuple[Windows, Windows] | None:
    """Older and newer half; None: a quarter would be too few rows."""
    count = sum(len(block.t) for block in windows)
    return split(windows, count // 2) if count // 4 >= ENOUGH * names else None


def _better(halves: tuple[Windows, Windows], pose: Pose, tune: Tune) -> bool:
    """Do rows before the newest quarter tell it better without the older half?"""
    old, new = halves
    before, last = split(new, sum(len(block.t) for block in new) // 2)
    posed = pose(last)
    used = posed.rows.used
    long, short = (
        np.square(np.where(used, posed.tuning(one.names).residuals(one.values), np.nan))
        for one in (tune(pose((*old, *before)))[1], tune(pose(before))[1])
    )
    known = np.isfinite(long) & np.isfinite(short)
    sums = [np.where(known, one, 0.0).sum(axis=0) for one in (long, short)]
    return bool(np.mean(sums[1] / np.maximum(sums[0], 1e-300)) <= 1.0 - CLEARLY)
