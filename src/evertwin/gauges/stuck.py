"""Is an input what it was, to the last digit, since about when the machine deviates?

A command may be held for as long as it likes, so an input is doubted only where it has not changed
for far longer than it ever did before, and the machine goes on as if it had.
"""

from __future__ import annotations

import numpy as np

from evertwin.gauges.sensor_change import SensorChange, unmeasured
from evertwin.rows.ring import called
from evertwin.setup.setup import Setup
from evertwin.setup.task import Windows
from evertwin.types import Vector

LONGER = 2.0
"""Rows without a change, by those of the longest time without one before."""
LEAST = 30
"""Rows without a change, at least."""
MOVES = 0.5
"""Spread of a watched output since then, at least [of the one before]."""


def stuck(setup: Setup, windows: Windows) -> SensorChange | None:
    """The input that no longer changes, of rows that deviate; None: there is none.

    Args:
        setup: of the twin.
        windows: rows before the deviation and since then.
    """
    if not windows:
        return None
    u, y = (np.concatenate([getattr(one, name) for one in windows]) for name in ("u", "y"))
    for k, channel in enumerate(setup.model.inputs.channels):
        first, longest = _since(u[:, k])
        count = len(u) - first
        if first < LEAST or count < max(LEAST, LONGER * longest) or not _moves(setup, y, first):
            continue
        row, after = windows[0].row, first
        for one in windows:
            row, after = one.row + after, after - len(one.t)
            if after < 0:
                break
        return SensorChange(channel.name, 0.0, (
            f"{channel.name} has not changed since {called(row)}, for {count} rows where {longest} "
            "were the most before, and the machine goes on as if it had: its signal no longer "
            "answers; nothing is learned from it"
        ), None, row)  # fmt: skip
    return None


def _since(values: Vector) -> tuple[int, int]:
    """First row of the newest run of one value, and the rows of the longest run before."""
    known = np.flatnonzero(np.isfinite(values))
    changes = known[1:][np.diff(values[known]) != 0.0] if len(known) else known
    if not len(changes):
        return 0, 0
    runs = np.diff([0, *changes.tolist()])
    return int(changes[-1]), int(runs.max())


def _moves(setup: Setup, y: np.ndarray, first: int) -> bool:
    """Does a watched output vary as it did before?"""
    with unmeasured():
        now, before = (np.nanstd(part[:, setup.watched], axis=0) for part in (y[first:], y[:first]))
    return bool((now >= MOVES * before).any())
