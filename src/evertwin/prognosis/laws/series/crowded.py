"""Readings weigh by time, not by count: thirty in a week among one a month are one or two.

The usual step of a series is that by which half of its time was passed, where steps that no
neighbour shares (a gap, a night) do not count. Of readings that lie within a share of `CROWD` of it
one stays, with the median value; so it is with more than `MOST`.

>>> at = np.r_[np.arange(0.0, 300.0, 30.0), 300.0 + np.arange(30.0) / 5.0]
>>> usual_step(at), usual_step(np.r_[np.arange(50.0), 200.0 + np.arange(50.0)])
(30.0, 1.0)
"""

from __future__ import annotations

import numpy as np

from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.types import Vector

BESIDE = 2
"""Steps on each side that a step is compared with."""
CROWD = 0.2
MOST = 3000
"""Readings that stay, about, of a series that was read however often."""


def usual_step(at: Vector) -> float:
    """The step by which half of the time was passed, steps that stand alone apart."""
    steps = np.diff(at)
    if not len(steps):
        return 0.0
    width = 2 * BESIDE + 1
    if len(steps) > width:
        inner = np.lib.stride_tricks.sliding_window_view(steps, width)
        steps = np.median(inner, axis=1)
    steps = np.sort(steps)
    passed = np.cumsum(steps)
    return float(steps[np.searchsorted(passed, 0.5 * passed[-1])])


def by_time(indicator: Indicator) -> Indicator:
    """The series with one reading where many crowd, seen from the same moment."""
    life = indicator.since_replaced()
    clock = life.at if life.usage is None else life.usage
    known = np.flatnonzero(np.isfinite(life.value))
    if not len(known):
        return indicator
    at = clock[known]
    many = len(at) / MOST
    wide = usual_step(at) * (CROWD if many <= 1.0 else many)
    if not wide > 0.0:
        return indicator
    part = np.floor((at[-1] - at) / wide).astype(np.int64)
    edges = np.r_[0, np.flatnonzero(np.diff(part)) + 1, len(at)]
    if len(edges) > len(at):
        return indicator
    kept = [
        a + int(np.argsort(life.value[known[a:b]], kind="stable")[(b - a) // 2])
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    ]
    return life.rows(known[kept]).seen_at(float(life.at[-1]))
