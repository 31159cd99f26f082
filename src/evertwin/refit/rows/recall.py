"""Rows of long ago, where the newest ones do not show a level of the command.

A table is learned level by level, and a machine is seldom at all of them within one window. Of each
level that the window holds little of, the newest rows before it are learned from as well.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from evertwin.correction.translation.sarsa_settings import SarsaSettings
from evertwin.fold import Block, Windows, take
from evertwin.gauges.changes.change import split
from evertwin.sync.horizon.horizon import nanoseconds

PREDICTIONS = 20
"""Length of the rows of a level that are enough, in horizons."""


def recalled(windows: Windows, newest: int, column: int, settings: SarsaSettings) -> Windows:
    """The ``newest`` rows, after the newest before them of each level that they lack.

    Args:
        windows: rows, in order.
        newest: length of the window in rows.
        column: the translated input.
        settings: its levels.

    >>> from evertwin.fold import make_block
    >>> u = np.repeat([0.03, 0.05, 0.03, 0.03], 30)[:, None]
    >>> rows = make_block(t=np.arange(120) * 10**9, u=u, y=u)
    >>> [(w.row, len(w.t)) for w in recalled((rows,), 30, 0, SarsaSettings("v"))]
    [(39, 21), (90, 30)]
    """
    old, new = split(windows, max(sum(len(w.t) for w in windows) - newest, 0))
    held = dict[int, float]()
    for block in new:
        for number, seconds in zip(_levels(block, column, settings), block.dt, strict=True):
            held[number] = held.get(number, 0.0) + seconds
    kept = list[Block]()
    for block in reversed(old):
        wanted, levels = np.zeros(len(block.t), dtype=np.bool_), _levels(block, column, settings)
        begins = np.searchsorted(block.t, block.t - nanoseconds(settings.horizon), "right") - 1
        for i in range(len(block.t) - 1, 0, -1):
            if held.get(levels[i], 0.0) < PREDICTIONS * settings.horizon:
                held[levels[i]] = held.get(levels[i], 0.0) + block.dt[i]
                wanted[max(min(begins[i], i - 1), 0) : i + 1] = True
        edges = np.flatnonzero(np.diff(wanted, prepend=False, append=False))
        kept += [take(block, a, b) for a, b in reversed(list(pairwise(edges.tolist()))[::2])]
    return *reversed(kept), *new


def _levels(block: Block, column: int, settings: SarsaSettings) -> list[int]:
    levels = np.floor((block.u[:, column] - settings.low) / settings.quantum + 0.5)
    return [int(level) if np.isfinite(level) else -1 for level in levels]
