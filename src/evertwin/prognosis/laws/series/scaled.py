"""From an indicator to numbers of order one: age 1 is now, distance 1 is the limit.

Only the current life counts, absent values are dropped, and long series are averaged over blocks. A
value that stands apart from the line through its neighbours (an outlier, a capacity that recovered
for a few cycles) keeps little weight: its variance is multiplied by (|z|/3)⁴ where its distance z,
in robust standard deviations, exceeds 3.

>>> from evertwin.prognosis.laws.series.indicator import Limit
>>> wear = Indicator.of("wear", "mm", Limit(2.0), np.arange(11.0), np.linspace(0.0, 1.0, 11))
>>> problem = scaled(wear)
>>> float(problem.s[-1]), round(problem.limit, 3)
(1.0, 1.0)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.types import Float64, Vector

LEAST = 6
"""Values at different times that a prediction needs."""
MOST = 384
"""Values that are kept; a longer series is averaged over blocks."""
TINY = 1e-150
"""Distances below this are none: their square vanishes in double precision."""
REACH = 3
"""Neighbours on each side with which a value is compared."""
APART = 3.0
"""Robust standard deviations from which a value loses weight."""

BLOCKS = 60
"""Values that a slope is told from; more are averaged."""


class Problem(NamedTuple):
    """The scaled series of the current life.

    >>> Problem._fields[:3]
    ('y', 's', 'omega')
    """

    y: Float64[np.ndarray, " n"]
    """Values, growing towards the limit, in distances from the median value to it."""
    s: Float64[np.ndarray, " n"]
    """Ages, now = 1."""
    omega: Float64[np.ndarray, " n"]
    """Relative variance of each value's noise."""
    fixed: Float64[np.ndarray, "n k"]
    """Columns: constant, shifts at adjustments, covariates."""
    base: Float64[np.ndarray, " k"]
    """The columns under which the limit holds."""
    limit: float
    age: float
    """Age now on the law's own clock (usage if there is any)."""
    now: float
    scale: float
    """Indicator's units per distance."""


def scaled(indicator: Indicator, most: int = MOST, least: int = LEAST) -> Problem | str:
    """The problem with at most ``most`` values (0: all), or what is missing of ``least``."""
    life = indicator.since_replaced()
    clock = life.at if life.usage is None else life.usage
    good = np.isfinite(life.value)
    for array in life.covariates.values():
        good &= np.isfinite(array)
    different = len(np.unique(clock[good]))
    if different < least:
        return (
            f"at least {least} values at different times since the component was new or replaced, "
            f"{least - different} more than there are"
        )
    origin = clock[good][0] if life.origin is None or life.usage is not None else life.origin
    age = float(clock[-1] - origin)
    raw = life.limit.sign * life.value[good]
    limit = life.limit.sign * life.limit.value
    middle = float(np.median(raw))
    scale = max(abs(limit - middle), float(np.median(np.abs(raw - middle))), 1e-12 * abs(limit))
    scale = scale if scale > TINY else 1.0
    y = np.clip((raw - middle) / scale, -1e6, 1e6)
    s = (clock[good] - origin) / age
    omega = noise(life.sigma[good]) * apart(y)
    fixed, base = columns(life, good)
    problem = Problem(
        y, s, omega, fixed, base, (limit - middle) / scale, age, float(life.at[-1]), scale
    )
    return thinned(problem, most) if 0 < most < len(y) else problem


def steady(at: Vector, y: Vector) -> tuple[float, float]:
    """(slope, level at the last value) of a line that no single value decides (Theil, Sen).

    >>> steady(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.0, 3.0, 40.0, 7.0]))
    (2.0, 7.0)
    """
    last = float(at[-1])
    if len(at) > BLOCKS:
        edges = np.linspace(0, len(at), BLOCKS + 1).astype(np.int64)
        counts = np.diff(edges)
        at, y = (np.add.reduceat(x, edges[:-1]) / counts for x in (at, y))
    first, second = np.triu_indices(len(at), 1)
    apart = at[second] - at[first]
    slopes = (y[second] - y[first])[apart > 0.0] / apart[apart > 0.0]
    slope = float(np.median(slopes)) if len(slopes) else 0.0
    return slope, float(np.median(y + slope * (last - at)))


def noise(sigma: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Variances relative to their median; 1 where none is known."""
    known = np.isfinite(sigma) & (sigma > 0.0)
    if not known.any():
        return np.ones(len(sigma))
    share: np.ndarray = np.clip(sigma / np.median(sigma[known]), 1e-2, 1e4) ** 2
    return np.where(known, share, 1.0)


def apart(y: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Factor on the variance of values that stand apart from their neighbours."""
    size = np.abs(neighbours(y, REACH))
    scale = 1.4826 * np.median(size)
    if scale <= 1e-9 * max(size.max(), 1e-300):
        scale = float(size.mean())
    if scale == 0.0:
        return np.ones(len(y))
    out: np.ndarray = np.minimum(np.maximum(size / scale / APART, 1.0) ** 4, 1e12)
    return out


def noise_of(y: Float64[np.ndarray, " n"]) -> float:
    """Standard deviation of the values around their neighbours, outliers apart."""
    rest = neighbours(y, REACH)
    # The median of six neighbours scatters as well, with about a quarter of one value's variance.
    return float(1.4826 * np.median(np.abs(rest)) / np.sqrt(1.25))


def neighbours(y: Float64[np.ndarray, " n"], reach: int) -> Float64[np.ndarray, " n"]:
    """Each value less the median of its neighbours, moved along their median step."""
    n = len(y)
    width = min(2 * reach + 1, n)
    if width < 2:
        return np.zeros(n)
    windows = np.lib.stride_tricks.sliding_window_view(y, width)
    first = np.clip(np.arange(n) - reach, 0, n - width)
    step = np.median(np.diff(windows, axis=1), axis=1)[first]
    away = first[:, None] + np.arange(width) - np.arange(n)[:, None]
    moved = windows[first] - step[:, None] * away
    return np.asarray(y - np.median(moved[away != 0].reshape(n, width - 1), axis=1))


def columns(life: Indicator, good: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(fixed columns, base): covariates are centred where the limit holds."""
    fixed, base = [np.ones(int(good.sum()))], [1.0]
    for mark in life.maintenance:
        if mark.kind == "adjusted":
            fixed.append((life.at[good] >= mark.at).astype(np.float64))
            base.append(1.0)
    for name, whole in life.covariates.items():
        x = whole[good]
        centre = life.reference.get(name, float(np.median(x)))
        spread = float(np.std(x))
        fixed.append((x - centre) / spread if spread > 0.0 else np.zeros(len(x)))
        base.append(0.0)
    return np.stack(fixed, axis=1), np.array(base)


def thinned(problem: Problem, most: int) -> Problem:
    """Averages over blocks, weighted, so that at most ``most`` values remain."""
    n = len(problem.y)
    edges = np.unique(np.linspace(0, n, most + 1).astype(np.int64))[:-1]
    weight = 1.0 / problem.omega
    total = np.add.reduceat(weight, edges)

    def mean(x: np.ndarray) -> np.ndarray:
        out: np.ndarray = np.add.reduceat(x * weight, edges) / total
        return out

    fixed = np.stack([mean(column) for column in problem.fixed.T], axis=1)
    return problem._replace(
        y=mean(problem.y), s=mean(problem.s), omega=n / most / total, fixed=fixed
    )
