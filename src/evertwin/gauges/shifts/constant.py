"""How large a constant on a channel is, or a share, and how sure, beside the machine's numbers.

The version as it is is not quite the machine, and what it is off by goes into a constant that is
learned alone: so the numbers that are tuned are learned beside it, on the rows before it too. What
is left then goes on for a while from row to row; so blocks of rows say how sure all of it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.gauges.rows.gauge_rows import Rows, residual
from evertwin.gauges.shifts import off_by
from evertwin.gauges.shifts.off_by import Column, recorded, undone
from evertwin.types import Bools, Outputs, Vector

BLOCKS = 12
"""Blocks of rows, each of which tells by itself."""
FEW_BLOCKS = 1.12
"""So many times larger are the sides of a number that so few blocks tell."""
ROUNDS = 2
"""Steps towards it: it need not be small."""
SIDES = 1.96
"""Standard errors on either side of a number that nearly always hold it."""
VAGUE = 3.0
"""Sides of so many times its size say nothing of a constant."""
STEP = 0.01
"""Share of a constant by which it is varied."""


class Constant(NamedTuple):
    """What came of it.

    >>> Constant(0.2, 0.01, 3.0).size
    0.2
    """

    size: float
    """[SI], or a share."""
    error: float
    """Standard error."""
    left: float
    """Squares that are left on the rows that it is of."""

    @property
    def told(self) -> bool:
        """Do its sides say anything of it, wide as they are beside all of the machine's numbers?"""
        return VAGUE * abs(self.size) > SIDES * self.error


def beside(rows: Rows, one: Column, shift: float, seen: Bools) -> Constant:
    """The constant by the rows ``seen``, of about ``shift``, and one machine on them and before."""
    used = seen | (np.arange(rows.count) < rows.since)
    names = tuple(name for name in rows.fit.names if name in rows.whole.names)
    size, values = shift, rows.whole.start
    for _ in range(ROUNDS):
        by, further = (_steady(rows, s) for s in (size, (1.0 + STEP) * size))
        there, more = (rows.pose(undone(rows.setup, rows.windows, one, b)) for b in (by, further))
        if names:
            there, more = there.tuning(names), more.tuning(names)
            values = there.start if values is rows.whole.start else values
        here = recorded(rows.setup, residual(there, values), one, by)
        other = recorded(rows.setup, residual(more, values), one, further)
        columns = ((other - here) / (STEP * size))[:, :, None]
        if names:
            columns = np.concatenate([columns, -there.jacobian(values)], axis=2)
        step = rows.least(columns, here, used)
        left = here + columns @ step
        size += float(step[0])
        values = np.clip(values + step[1:], *there.bounds) if names else values
    return Constant(size, _error(rows, columns, left, used), rows.total(left, seen))


def _error(rows: Rows, columns: np.ndarray, left: Outputs, used: Bools) -> float:
    """Standard error of how much of the first column there is."""
    a, b = columns / rows.sizes[:, None], left / rows.sizes
    known = used[:, None] & np.isfinite(b) & np.isfinite(a).all(axis=2)
    a, b = np.where(known[:, :, None], a, 0.0), np.where(known, b, 0.0)
    flat = a.reshape(-1, a.shape[2])
    rest = flat[:, 1:] @ np.linalg.lstsq(flat[:, 1:], flat[:, 0], rcond=1e-9)[0]
    own = (flat[:, 0] - rest).reshape(b.shape)
    power = float(np.sum(own * own))
    parts = np.array_split(np.flatnonzero(used), BLOCKS)
    pulls = np.array([float(np.sum(own[part] * b[part])) for part in parts])
    return FEW_BLOCKS * float(np.sqrt(np.sum(pulls**2))) / power if power > 0.0 else np.inf


def left_with(rows: Rows, one: Column, shift: float, stop: int | None = None) -> Outputs:
    """Residual with that taken off up to row ``stop``, in what was recorded."""
    by = _steady(rows, shift, stop)
    return off_by.left_with(rows.setup, rows.posed, rows.windows, one, by)


def _steady(rows: Rows, shift: float, stop: int | None = None) -> Vector:
    at = np.arange(rows.count)
    return np.where((at >= rows.since) & (at < (rows.stop if stop is None else stop)), shift, 0.0)
