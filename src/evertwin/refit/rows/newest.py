"""The machine as it is now, where it goes on changing: a fit to all rows is of a machine that was.

Of the rows that tell the change, the newest quarter is predicted by a fit to all rows before it and
by one to the quarter before it. Where the latter is clearly the better one, the older half is left
out, and the question is asked again. A form that is wrong has each fit favour the rows about it by
chance; of a machine that changes the oldest quarter is told better by the next one alone, too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from evertwin.errors import DataError, ModelError
from evertwin.fold import Windows, take
from evertwin.gauges.changes.change import split, swings_alike
from evertwin.refit.numbers.fewest import Tune
from evertwin.tuning import Fit, Problem
from evertwin.tuning.posing.recordings import beginning
from evertwin.types import Bools, Vector

CLEARLY = 0.3
"""Share of the squared deviation that newer rows take away at least."""
ENOUGH = 30
"""Rows a parameter that a fit needs."""
Pose: TypeAlias = Callable[[Windows], Problem]


def newest(problem: Problem, fit: Fit, pose: Pose, tune: Tune) -> tuple[Problem, Fit]:
    """What was tuned, and the fit, on the newest rows if these tell another machine than all do.

    Args:
        problem: tuned, on the rows since the machine changed.
        fit: to these rows.
        pose: the same problem on some of them.
        tune: as the candidate is tuned.
    """
    try:
        while rows := _half(problem.windows, len(fit.names)):
            if not (swings_alike(*rows) and _better(rows, pose, tune)):
                break
            problem, fit, _ = tune(pose(rows[1]))
    except (DataError, ModelError):  # too few rows, or none that tell
        pass
    return problem, fit


def _half(windows: Windows, names: int) -> tuple[Windows, Windows] | None:
    """Older and newer half; None: a quarter would be too few rows."""
    count = sum(len(block.t) for block in windows)
    return split(windows, count // 2) if count // 4 >= ENOUGH * names else None


def _better(halves: tuple[Windows, Windows], pose: Pose, tune: Tune) -> bool:
    """Do rows before the newest quarter tell it better without the older half, and rows behind the
    oldest quarter that without the newer half?"""
    old, new = halves
    first, second = (sum(len(block.t) for block in half) // 2 for half in halves)
    before, behind = split(new, second)[0], split(old, first)[1]
    young, aged = pose(new), pose(old)
    late = np.arange(len(young.rows.used)) >= second
    early = np.arange(len(aged.rows.used)) < first
    return _nearer(young, late, ((*old, *before), before), pose, tune) and _nearer(
        aged, early, ((*behind, *new), behind), pose, tune
    )


def _nearer(
    posed: Problem, at: Bools, rows: tuple[Windows, Windows], pose: Pose, tune: Tune
) -> bool:
    """Is what the second of ``rows`` tell clearly nearer to those ``at`` some than what the first
    tell?"""
    long, short = (tune(pose(one))[1] for one in rows)
    begins = None if at[0] else short  # rows behind the first tell nothing of how these began
    used = posed.rows.used & at[:, None]
    off = [
        np.square(np.where(used, posed.residuals(_with(posed, fit, begins)), np.nan))
        for fit in (long, short)
    ]
    known = np.isfinite(off[0]) & np.isfinite(off[1])
    sums = [np.where(known, one, 0.0).sum(axis=0) for one in off]
    return bool(np.mean(sums[1] / np.maximum(sums[0], 1e-300)) <= 1.0 - CLEARLY)


def _with(posed: Problem, fit: Fit, begins: Fit | None) -> Vector:
    """The machine's numbers of one fit; how recordings began of the other, which is of the same;
    None: as it starts."""
    begun = beginning(posed.model, posed.names)
    values = posed.start.copy()
    for k, name in enumerate(posed.names):
        one = begins if name in begun else fit
        if one and name in one.names:
            values[k] = one[name]
    return values


def after(windows: Windows, row: int, until: int | None = None) -> Windows:
    """The rows from number ``row`` on, up to that before ``until``.

    >>> from evertwin.fold import make_block
    >>> rows = make_block(t=range(4), u=np.zeros((4, 1)), y=np.zeros((4, 1)))
    >>> [len(block.t) for block in after((rows,), 3)], after((rows,), 4)
    ([1], ())
    >>> [len(block.t) for block in after((rows,), 0, 3)]
    [3]
    """
    spans = [
        (block, max(row - block.row, 0), len(block.t) if until is None else until - block.row)
        for block in windows
    ]
    return tuple(
        take(block, first, min(last, len(block.t))) for block, first, last in spans
        if first < min(last, len(block.t))
    )  # fmt: skip


def newer(windows: Windows, least: int) -> Windows:
    """The newer half of some rows: what is of a machine that goes on changing is judged there; none
    where it would be fewer than ``least``.

    >>> from evertwin.fold import make_block
    >>> rows = make_block(t=range(5), u=np.zeros((5, 1)), y=np.zeros((5, 1)))
    >>> [[len(block.t) for block in newer((rows,), least)] for least in (3, 4)]
    [[3], []]
    """
    count = sum(len(block.t) for block in windows)
    return split(windows, count // 2)[1] if count - count // 2 >= least else ()
