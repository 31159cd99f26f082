"""What a fit predicts over: tasks, or windows that are cut out of them.

Over a whole task a free run of a slightly wrong model drifts so far that its end says little; over
windows every one of them starts anew from the measured state. An output that is only a start (a
speed that nothing measures, derived from the position) is given at the rows where a prediction
starts and nowhere else, so nothing is compared with it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from evertwin.config.spec import CutSpec
from evertwin.errors import ConfigError, DataError
from evertwin.fold import Block, Windows, take
from evertwin.setup.setup import Setup
from evertwin.sync.horizon.horizon import nanoseconds


def windows_of(windows: Iterable[Block], rule: CutSpec | None) -> Windows:
    """The windows that the twin file asks for; what is shorter than one is left out.

    Args:
        windows: tasks.
        rule: length and step; None: the tasks themselves.

    Raises:
        DataError: no task is as long as a window, or has more windows than rows.

    >>> from evertwin.fold import make_block
    >>> rows = make_block(t=np.arange(10) * 10**9, u=np.zeros((10, 1)), y=np.zeros((10, 1)))
    >>> [len(w.t) for w in windows_of([rows], CutSpec(length=4.0, step=2.0))]
    [4, 4, 4, 4]
    """
    tasks = tuple(windows)
    if rule is None:
        return tasks
    length = nanoseconds(rule.length)
    step = nanoseconds(rule.length if rule.step is None else rule.step)
    found = []
    for task in tasks:
        # the last row of a window is one interval before the end of its length
        last = int(task.t[-1]) + (int(np.median(np.diff(task.t))) if len(task.t) > 1 else 0)
        begins = range(int(task.t[0]), last - length + 1, max(step, 1))
        if len(begins) > len(task.t):
            raise DataError(
                f"[tuning.cut]: {len(begins)} windows of {len(task.t)} rows: expected "
                "at most one for each row: give a longer step"
            )
        for start in begins:
            a, b = np.searchsorted(task.t, [start, start + length])
            if b - a >= 2:
                found.append(take(task, int(a), int(b)))
    if not found:
        raise DataError(
            f"[tuning.cut]: no recording is as long as a window of {rule.length:g} s: "
            "give longer recordings or a shorter length"
        )
    return tuple(found)


def starts(setup: Setup, windows: Windows) -> Windows:
    """The windows, with outputs that are only starts left out of all rows but the first.

    Raises:
        ConfigError: predictions start again within a task, by ``[prediction] horizon``.
    """
    names = setup.model.outputs.names
    known = setup.spec.signals
    only = np.array([n in known and not known[n].judge for n in names])
    if not only.any():
        return windows
    if np.isfinite(setup.horizon):
        raise ConfigError(
            f"[signals.{names[int(np.argmax(only))]}] judge = false: expected no [prediction] "
            "horizon: a fit starts such an output once per window (see [tuning.cut])"
        )
    out = []
    for window in windows:
        y = window.y.copy()
        later = ~window.gap
        later[0] = False
        y[np.ix_(later, only)] = np.nan
        out.append(window._replace(y=y))
    return tuple(out)


def apart(windows: Windows) -> Windows:
    """Of overlapping windows as many as share no row: for held-out errors.

    >>> from evertwin.fold import make_block
    >>> rows = make_block(t=np.arange(10) * 10**9, u=np.zeros((10, 1)), y=np.zeros((10, 1)))
    >>> [w.row for w in apart(windows_of([rows], CutSpec(length=4.0, step=2.0)))]
    [0, 4]
    """
    kept: list[Block] = []
    for window in windows:
        if not kept or window.row >= kept[-1].row + len(kept[-1].t):
            kept.append(window)
    return tuple(kept)
