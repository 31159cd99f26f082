"""The onset of wear: a warning before anything can be said about the life.

Looked at is the median of the newest `SHORT` values, beside the lowest median of `LONG` that there
was: a baseline that run-in pulls down and no single value moves. Wear has begun where

* the median lies `SHARE` of the way from the baseline to the limit above it (an effect, not a
  significance: every long series differs from its beginning by something; where values are told by
  their logarithms, of the way of the values too);
* that is `SURE` times the scatter of such medians from one to the next, which holds the noise with
  whatever it leans on the values before, or of half the doubt that the values state themselves:
  what a fit is unsure of it may be unsure of in one direction for long;
* at least `OUTSIDE` of the way was grown outside stops. At a stop (a gap of `GAP` usual steps, or
  an adjustment) the level may shift: what it shifted by is no wear.

The warning is withdrawn where less than `KEEPS` of that is left, and given again when it returns.

>>> from evertwin.prognosis.laws.series.indicator import Limit
>>> rng = np.random.default_rng(0)
>>> y = 1.0 + 0.02 * rng.standard_normal(200)
>>> y[150:] += 0.02 * np.arange(50)
>>> found = find_onset(Indicator.of("wear", "mm", Limit(3.0), np.arange(200), y))
>>> found is not None and 145 < found.begin < 165 < found.told < 175
True
"""

from __future__ import annotations

import numpy as np

from evertwin.prognosis.laws.series.crowded import usual_step
from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.prognosis.laws.series.life import Onset
from evertwin.prognosis.laws.series.scaled import Problem, noise_of, scaled
from evertwin.types import Float64, Vector

SHORT, LONG = 12, 48
"""Values of a median, and of the baseline's; a quarter and a third of a shorter series."""
SHARE = 0.15
"""Of the way from the baseline to the limit."""
SURE = 5.0
OUTSIDE = 0.03
GAP = 10.0
KEEPS = 0.5
CHANCE = 2.0
"""Standard deviations up to which the difference of two medians is noise."""
FEW = 4
"""Steps between medians that tell their scatter."""


def find_onset(indicator: Indicator) -> Onset | None:
    """The onset of wear in the current life, as long as its warning stands."""
    problem = scaled(indicator, most=0)
    if isinstance(problem, str):
        return None
    life = indicator.since_replaced()
    at = life.at[known_rows(life)]
    y = without_covariates(problem)
    starts = stops(at, life)
    short = int(np.clip(len(y) // 4, 3, SHORT))
    long = int(np.clip(len(y) // 3, 3, LONG))
    level = medians(y, short)
    base = medians(y, long)
    base[: short - 1] = base[short - 1]  # of fewer values a single one moves it
    base = np.minimum(np.minimum.accumulate(base), np.median(y[:long]))
    way = problem.limit - base
    grown = np.where(way > 0.0, level - base, 0.0)
    effect = grown / np.where(way > 0.0, way, 1.0)
    if indicator.ratio:
        unit = indicator.limit.sign * problem.scale
        share = np.expm1(unit * grown) / np.expm1(unit * np.where(way > 0.0, way, 1.0))
        effect = np.minimum(effect, share)
    outside = effect - _shifted(y, starts, short) / np.where(way > 0.0, way, 1.0)
    scatter = np.maximum(_scatter(y, level, short), _stated(life, problem.scale, short))
    sure = grown / np.maximum(SURE * scatter, 1e-12)
    strength = np.minimum(np.minimum(effect / SHARE, sure), outside / OUTSIDE)
    strength[: min(long, len(y)) - 1] = 0.0
    told = _standing(strength)
    if told is None:
        return None
    calm = np.flatnonzero(effect[: told + 1] <= OUTSIDE)
    begin = int(calm[-1]) if len(calm) else 0
    return Onset(float(at[begin]), float(at[told]))


def _standing(strength: Vector) -> int | None:
    """The row from which the warning stands; None where it never did, or was withdrawn."""
    told: int | None = None
    for k, size in enumerate(strength.tolist()):
        if told is None and size >= 1.0:
            told = k
        elif told is not None and size < KEEPS:
            told = None
    return told


def without_covariates(problem: Problem) -> Float64[np.ndarray, " n"]:
    """The values as they would be where the limit holds, wear apart from covariates by a line."""
    if problem.fixed.shape[1] == 1:
        return problem.y
    line = np.column_stack([problem.fixed, problem.s])
    beta = np.linalg.lstsq(line, problem.y, rcond=None)[0]
    out: np.ndarray = problem.y - (problem.fixed - problem.base)[:, 1:] @ beta[1:-1]
    return out


def stops(at: Vector, life: Indicator) -> list[int]:
    """Rows that follow a stop or an adjustment."""
    steps = np.diff(at)
    after = set((np.flatnonzero(steps > GAP * usual_step(at)) + 1).tolist())
    after |= {int(np.searchsorted(at, m.at)) for m in life.maintenance if m.kind == "adjusted"}
    return sorted(k for k in after if 0 < k < len(at))


def known_rows(life: Indicator) -> np.ndarray:
    """Rows with a value and all covariates."""
    every = np.stack([life.value, *life.covariates.values()])
    good: np.ndarray = np.isfinite(every).all(axis=0)
    return good


def medians(y: Vector, width: int) -> Vector:
    """Median of the newest ``width`` values at each row; of as many as there are before."""
    first = [float(np.median(y[: k + 1])) for k in range(min(width - 1, len(y)))]
    windows = np.lib.stride_tricks.sliding_window_view(y, width)
    return np.concatenate([first, np.median(windows, axis=1)])


def _shifted(y: Vector, starts: list[int], width: int) -> Vector:
    """What stops have raised the level by until each row, beyond what noise does."""
    out, noise = np.zeros(len(y)), CHANCE * noise_of(y) * np.sqrt(np.pi / width)
    for k in starts:
        step = float(np.median(y[k : k + width]) - np.median(y[max(k - width, 0) : k]))
        out[k:] += step if step > noise else 0.0
    return out


def _stated(life: Indicator, scale: float, width: int) -> Vector:
    """Half of the newest values' own standard deviation at each row; 0 where none is stated."""
    sigma = life.sigma[known_rows(life)]
    return 0.5 * medians(np.where(np.isfinite(sigma), sigma, 0.0), width) / abs(scale)


def _scatter(y: Vector, level: Vector, width: int) -> Vector:
    """Standard deviation of a median until each row, from those that share no value.

    Steady growth is no scatter. Few medians tell less than the values' own noise does.
    """
    out = np.full(len(level), noise_of(y) * np.sqrt(0.5 * np.pi / width))
    apart = np.diff(level[width - 1 :: width])
    for k in range(FEW, len(apart) + 1):
        off = np.abs(apart[:k] - np.median(apart[:k]))
        row = (k + 1) * width - 1
        out[row:] = max(1.4826 * float(np.median(off)) / np.sqrt(2.0), 0.5 * float(out[0]))
    return out
