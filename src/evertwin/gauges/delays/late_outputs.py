"""Do all outputs of a static map come late behind what predicts them, or early?

A controller that reports its torques some rows after its motion leaves what follows each change of
the motion: friction would be tuned to it, or contacts seen. One shift of all outputs explains it,
with the numbers as they held.

>>> t = np.arange(400.0)
>>> predicted = np.stack([np.sin(0.1 * t), np.cos(0.07 * t)], axis=1)
>>> measured = np.roll(predicted, 4, axis=0)
>>> shift_of(measured, predicted, np.zeros(400, dtype=np.int64), 10).rows
4
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.gauges.rows.sensor_change import SensorChange, since_change, unmeasured
from evertwin.tuning import Fit, Problem
from evertwin.types import Int64, Outputs

LONGEST = 0.5
"""The longest shift that is looked for [s]."""
LEFT, TUNED, KNOWN = 0.5, 0.5, 0.5
"""Share of the squared deviation that it leaves at most: of all, and of what tuning leaves; and of
the values at least that are compared under it."""


class Shift(NamedTuple):
    """A shift of all outputs.

    >>> Shift(2, 0.1).rows
    2
    """

    rows: int
    """By which they come late; negative: early."""
    left: float
    """Share of the squared deviation that it leaves."""


def shift_of(
    measured: Outputs, predicted: Outputs, piece: Int64[np.ndarray, " n"], most: int
) -> Shift:
    """The shift of up to ``most`` rows that leaves least, within pieces of rows."""
    size = np.nanmean(np.square(measured - predicted), axis=0)
    size = np.where(size > 0.0, size, np.inf)
    left, least = {0: 1.0}, KNOWN * np.isfinite(measured - predicted).sum()
    for rows in range(-most, most + 1):
        late, early = max(rows, 0), max(-rows, 0)
        y, seen = (one[a : len(one) - b] for one, a, b in
                   ((measured, late, early), (predicted, early, late)))  # fmt: skip
        same = piece[late : len(piece) - early] == piece[early : len(piece) - late]
        off = np.square(y - seen)[same]
        if rows and np.isfinite(off).sum() > least:
            left[rows] = float(np.nanmean(np.nanmean(off, axis=0) / size))
    best = min(left, key=lambda rows: left[rows])
    return Shift(best, left[best])


@unmeasured()
def late_outputs(problem: Problem, fit: Fit) -> SensorChange | None:
    """The shift that explains what no tuning does; None: there is none, or no more than a row.

    Args:
        problem: of a static map, on the rows of the machine as it is now, from where it held.
        fit: of its numbers.
    """
    dt = problem.rows.dt
    step = float(np.median(dt[dt > 0.0])) if (dt > 0.0).any() else 0.0
    most = min(round(LONGEST / step), len(dt) // 4) if step else 0
    if len(problem.model.states) or most < 2 or problem.rows.y.shape[1] < 2:
        return None
    measured = np.where(problem.rows.used, problem.rows.y, np.nan)
    seen, piece = problem.predict(problem.start), np.cumsum(dt <= 0.0)
    first = since_change(measured - seen)
    measured, seen, tuned = (one[first:] for one in (measured, seen, problem.predict(fit.values)))
    found = shift_of(measured, seen, piece[first:], min(most, len(seen) // 4))
    before, after = (np.nanmean(np.square(measured - one), axis=0) for one in (seen, tuned))
    share = float(np.nanmean(after / before))
    if abs(found.rows) < 2 or found.left > LEFT or found.left > TUNED * share:
        return None
    way = "late" if found.rows > 0 else "early"
    said = (
        f"all outputs come {1e3 * abs(found.rows) * step:.3g} ± {1e3 * step:.2g} ms {way}, "
        f"compared with what predicts them: this explains {100 * (1.0 - found.left):.0f} % of the "
        f"deviation, tuning {100 * max(1.0 - share, 0.0):.0f} %; nothing is learned from it"
    )
    return SensorChange("", 1.0, said)
