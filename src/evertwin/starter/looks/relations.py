"""What numbers say of each other: is one column the derivative of another, and in which unit?

A column's change over some rows is compared with the other's integral over the same rows, which
noise of single samples hardly touches.

>>> t = np.arange(0.0, 10.0, 0.01)
>>> found = derivative(t, np.degrees(np.sin(t)), np.cos(t))
>>> found.correlation > 0.99, round(found.factor, 2)
(True, 57.3)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from evertwin.types import Vector

SPAN = 8
"""Rows that changes are taken over; where these are too few to tell, longer ones are tried."""
CLEAR = 0.95
"""Correlation from which a column counts as another's derivative."""


class Relation(NamedTuple):
    """How well one column's integral follows another's change.

    >>> Relation(0.99, 57.3).clear
    True
    """

    correlation: float
    factor: float
    """Change over integral: 57.3 where an angle in degrees has a speed in rad/s."""

    @property
    def clear(self) -> bool:
        """Is it one?"""
        return self.correlation >= CLEAR


def derivative(t: Vector | None, of: Vector, by: Vector) -> Relation:
    """Is ``by`` the derivative of ``of``? Without stamps the factor has no scale: NaN."""
    best = Relation(0.0, math.nan)
    for span in (SPAN, 4 * SPAN, 16 * SPAN):
        found = _over(t, of, by, span)
        if found.correlation > best.correlation:
            best = found
        if best.clear:
            break
    return best


def wraps(angle: Vector) -> bool:
    """Is an angle [rad] cut at half a turn, or a whole one? It jumps by one now and then.

    >>> wraps(np.arange(100.0) % (2 * np.pi)), wraps(np.sin(np.arange(100.0)))
    (True, False)
    """
    known = angle[np.isfinite(angle)]
    steps = np.abs(np.diff(known))
    if len(steps) < SPAN or float(np.ptp(known)) > 2.02 * math.pi:
        return False
    cut = np.abs(steps - 2 * math.pi) < 0.5 * math.pi
    return bool(cut.any() and cut.mean() < 0.5 and np.median(steps[~cut]) < 0.5 * math.pi)


def _over(t: Vector | None, of: Vector, by: Vector, span: int) -> Relation:
    if len(of) < 4 * span:
        return Relation(0.0, math.nan)
    dt = np.ones(len(of) - 1) if t is None else np.diff(t)
    steps = 0.5 * (by[1:] + by[:-1]) * dt
    good = np.isfinite(steps) & (dt > 0) & (dt < 20 * np.nanmedian(dt))
    whole = np.concatenate([[0.0], np.cumsum(np.where(good, steps, 0.0))])
    broken = np.concatenate([[0], np.cumsum(~good)])
    integral, change = whole[span:] - whole[:-span], of[span:] - of[:-span]
    sound = np.isfinite(change) & (broken[span:] == broken[:-span])
    a, b = change[sound], integral[sound]
    wrapped = np.abs(a) > 20 * np.median(np.abs(a) + 1e-300) + 20 * np.mean(np.abs(a))
    a, b = a[~wrapped], b[~wrapped]
    power = float(b @ b)
    spread = float(np.sqrt((a @ a) * power)) if len(a) > 8 else 0.0
    if not spread > 0.0:
        return Relation(0.0, math.nan)
    factor = math.nan if t is None else float(a @ b) / power
    return Relation(float(a @ b) / spread, factor)
