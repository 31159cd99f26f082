"""What the usual course of a channel's own record tells of a shift in it.

Where its sensor goes off, the record leaves its course, an autoregression of the rows before, by
just that; where the machine changed, it does not. A course is known for no longer than it was seen.
"""

from __future__ import annotations

import numpy as np

from evertwin.gauges.rows.gauge_rows import LEAST
from evertwin.types import Float64, Vector

CLEAR = 3.0
"""Logarithm of the likelihood ratio from which on the record speaks for one side."""
ORDER = 5
"""Rows that the usual course goes back."""
AT_ONCE = 8
"""Rows within which a step is complete, and up to so many from where it is looked for."""
STRETCHES = 12
"""Parts of the rows before whose means tell how far the record strays slowly."""
STRAYS = 2.0
"""So many times as far as it strays in as long by itself what has grown has to be."""
HALF = 0.5
"""Part of a shift from which on a step of the record is as large."""
FREEDOM = 3.0
"""Degrees of freedom of steps (Student's t): some are far larger than most."""


def evidence(record: Vector, size: float, span: tuple[int, int]) -> float:
    """Logarithm of how much likelier the record is with a shift in it than without, by its course
    before; 0: too few rows tell it.

    >>> record, off = np.random.default_rng(0).normal(size=900), 9.0 * (np.arange(900) >= 600)
    >>> evidence(record + off, 9.0, (600, 600)) > 3.0, evidence(record, 9.0, (600, 600)) < -3.0
    (True, True)
    """
    first, last = span
    if first < LEAST * ORDER or last > 2 * first:  # no longer than it was seen a course is known
        return 0.0
    course = _innovations(record, shape_of(len(record), first, last), first)
    if course is None:
        return 0.0
    innovation, shape, spread = course
    at = first + AT_ONCE if first == last else first
    g, e = shape[at : 2 * first], innovation[at : 2 * first]
    known = np.isfinite(e)
    g, e = g[known], e[known]
    if abs(size) < STRAYS * _strays(record[:first], last - first):
        return 0.0
    found = 0.0
    if (power := float(g @ g)) > 0.0:
        seen = float(g @ e) / power
        variance = spread**2 * (1.0 / power + (float(g.sum()) / power) ** 2 / first)
        found = (seen**2 - (seen - size) ** 2) / (2.0 * variance)
    step = _stepped(record, size, first) if first == last else 0.0
    return step if step < -CLEAR else found + step  # what came at once is seen to, or did not


def shape_of(n: int, first: int, last: int) -> Vector:
    """It rises from ``first`` to ``last`` and stays; a step where both are one, (n,).

    >>> shape_of(5, 1, 2).tolist(), shape_of(3, 1, 1).tolist()
    ([0.0, 0.5, 1.0, 1.0, 1.0], [0.0, 1.0, 1.0])
    """
    grown = (np.arange(n) - first + 1.0) / max(last - first + 1.0, 1.0)
    return np.asarray(np.clip(grown, 0.0, 1.0))


def _lagged(columns: Float64[np.ndarray, "n k"]) -> Float64[np.ndarray, "m j"]:
    """What each column was 1 to ``ORDER`` rows before, of the rows from ``ORDER`` on."""
    n = len(columns)
    return np.hstack([columns[ORDER - 1 - j : n - 1 - j] for j in range(ORDER)])


def _strays(record: Vector, rows: int) -> float:
    """How far a record strays by itself within so many rows; a step takes none."""
    half = STRETCHES // 2
    means = np.array([np.nanmean(part) for part in np.array_split(record, STRETCHES)])
    usual = float(np.sqrt(np.mean(np.square(means[half:] - means[:half]))))
    return usual * rows / (len(record) / 2.0)


def _innovations(record: Vector, shape: Vector, first: int) -> tuple[Vector, Vector, float] | None:
    """What the record brings that the rows before it do not tell, the same of a shift's shape, and
    the usual size of the former; an autoregression of the rows before ``first``."""
    n, back = len(record), _lagged(record[:, None])
    known = np.isfinite(back).all(axis=1) & np.isfinite(record[ORDER:])
    early = known & (np.arange(ORDER, n) < first)
    if np.count_nonzero(early) < LEAST:
        return None
    ones = np.ones(len(back))
    columns = np.column_stack([ones, back])
    weights = np.linalg.lstsq(columns[early], record[ORDER:][early], rcond=None)[0]
    e, g = np.full(n, np.nan), np.zeros(n)
    e[ORDER:] = np.where(known, record[ORDER:] - columns @ weights, np.nan)
    g[ORDER:] = shape[ORDER:] - _lagged(shape[:, None]) @ weights[1:]
    spread = float(np.std(e[ORDER:][early]))
    return (e, g, spread) if spread > 0.0 else None


def _stepped(record: Vector, size: float, first: int) -> float:
    """The same of the step alone, wherever near ``first`` it is: from one row to the next, or
    within `AT_ONCE`, whichever is likelier; no more than how rarely it steps so by itself tells."""
    told = max(_stepped_within(record, size, first, rows) for rows in (1, AT_ONCE))
    return told if told > -np.inf else 0.0


def _stepped_within(record: Vector, size: float, first: int, rows: int) -> float:
    steps = record[rows:] - record[:-rows]
    begin = max(first - AT_ONCE - rows, 0)
    usual, near = steps[:begin], steps[begin : first + AT_ONCE]
    usual, near = usual[np.isfinite(usual)], near[np.isfinite(near)]
    scale = 1.4826 * float(np.median(np.abs(usual - np.median(usual)))) if len(usual) else 0.0
    if not scale > 0.0 or not len(near):
        return -np.inf

    def loss(off: Vector) -> Vector:
        half = 0.5 * (FREEDOM + 1.0)
        return np.asarray(half * np.log1p(np.square(off / scale) / FREEDOM))

    gain = loss(near) - loss(near - size)
    told = float(np.log(np.mean(np.exp(gain - gain.max()))) + gain.max())
    often = np.count_nonzero(np.abs(usual) > HALF * abs(size)) // rows
    rare = np.log((len(usual) + 1.0) / ((often + 1.0) * len(near)))
    return min(told, max(float(rare), 0.0))
