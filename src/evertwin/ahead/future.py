"""What the machine will be told: the inputs of the rows to come.

Either planned (rows of a file), or the newest stretch again (``repeat``: production goes on as it
was), or the last value for ever (``hold``).

>>> from evertwin.fold import make_block
>>> rows = make_block(t=np.arange(4) * 10**9, u=[[1.0], [2.0], [3.0], [4.0]], y=np.zeros((4, 1)))
>>> coming(rows, 5.0, "repeat").u.ravel().tolist()
[2.0, 3.0, 4.0, 2.0, 3.0]
>>> coming(rows, 2.0, "hold").u.ravel().tolist()
[4.0, 4.0]
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.fold import Block
from evertwin.types import Inputs, Intervals, Vector

Mode = Literal["repeat", "hold"]
LARGEST = 1_000_000
"""Most rows of a forecast."""


class Future(NamedTuple):
    """Inputs and intervals of rows to come.

    >>> Future(np.zeros((2, 1)), np.ones(2)).t.tolist()
    [1.0, 2.0]
    """

    u: Inputs
    dt: Intervals

    @property
    def t(self) -> Vector:
        """Time from now at the end of each row [s]."""
        return np.cumsum(self.dt)


def coming(last: Block, horizon: float, mode: Mode) -> Future:
    """The rows of the next ``horizon`` [s] after a recorded block.

    Raises:
        UsageError: the horizon is no duration above zero, or far too long for the rate.
        DataError: the block holds a single row, so no rate.
    """
    if not 0.0 < horizon < np.inf:
        raise UsageError(f"horizon: expected a duration above 0 s, got {horizon}")
    if len(last.t) < 2:
        raise DataError("forecast: expected at least two rows to know the rate, got one")
    u, dt = last.u[1:], last.dt[1:]
    known = np.isfinite(u).all(axis=1)
    if not known.any():
        raise DataError("forecast: no row of the last task has all its inputs")
    u, dt = u[known], dt[known]
    if mode == "hold":
        step = float(np.median(dt))
        n = _count(horizon / step)
        return Future(np.repeat(u[-1:], n, axis=0), np.full(n, step))
    back = np.cumsum(dt[::-1])
    n = min(int(np.searchsorted(back, horizon * (1 - 1e-9))) + 1, len(u))
    u, dt = u[len(u) - n :], dt[len(dt) - n :]
    _count(horizon / float(dt.mean()))
    times = _count(horizon / float(dt.sum()))
    u, dt = np.tile(u, (times, 1)), np.tile(dt, times)
    stop = int(np.searchsorted(np.cumsum(dt), horizon * (1 - 1e-9))) + 1
    return Future(np.ascontiguousarray(u[:stop]), dt[:stop])


def _count(size: float) -> int:
    rows = max(float(np.ceil(size * (1 - 1e-9))), 1.0)
    if not rows <= LARGEST:
        raise UsageError(
            f"horizon: {rows:.7g} rows at this rate, expected {LARGEST} at most: shorten it"
        )
    return int(rows)
