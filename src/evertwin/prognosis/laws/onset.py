"""The onset of wear: a warning before anything can be said about the life.

Each value is compared with what the values before it foretell (level, covariates and, where the
series persists, the value before): the recursive residual, over its own standard error, follows a
Student distribution while nothing changes, whatever level and spread are. It is turned into a
standard normal score u, cut at ± 4, and summed,

    C ← max(0, C + u − k),     alarm when C > h,   k = ½

on the harmful side alone. Nothing has to be calibrated before. h follows from the false alarms
that are allowed: a run without change lasts, on average, (e^(2kb) − 2kb − 1)/(2k²) values with
b = h + 1.166. Values are not learned from while C is above half its limit, so that wear is not
taken for normal; that makes false alarms about half as frequent again, which `MARGIN` covers. The
onset is where C last was zero.

>>> rng = np.random.default_rng(0)
>>> y = rng.standard_normal(200)
>>> y[150:] += 0.2 * np.arange(50)
>>> found = first_alarm(y, np.ones((200, 1)))
>>> found is not None and 145 < found[0] < 165 and found[0] < found[1] < 175
True

Sources: Hawkins and Olwell, "Cumulative Sum Charts" (1998), ch. 7, self-starting charts; Siegmund,
"Sequential Analysis" (1985), for the run length.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import scipy

from evertwin.compiled.functions import njit
from evertwin.prognosis.laws.indicator import Indicator
from evertwin.prognosis.laws.life import Onset
from evertwin.prognosis.laws.scaled import scaled
from evertwin.types import Float64

FALSE_ALARMS = 1e-4
"""False alarms per value."""
SHIFT = 0.5
"""k: half the shift, in standard deviations of what is new, that is found soonest."""
CUT = 4.0
"""Scores are cut here: no single value raises the alarm."""
FIRST = 8
"""Values that the first comparison rests on, besides one per column."""
STEP = 0.025
"""Of the table of scores."""
MARGIN = 2.0
CALM = 100
"""First values that tell how much a value leans on the one before."""


def limit_of(false_alarms: float) -> float:
    """The limit h of the CUSUM.

    >>> round(limit_of(1e-3), 2)
    5.06
    """

    def excess(b: float) -> float:
        a = 2.0 * SHIFT * b
        return math.log((math.exp(a) - a - 1.0) / (2.0 * SHIFT**2)) + math.log(false_alarms)

    return float(scipy.optimize.brentq(excess, 1e-3, 200.0)) - 1.166


def find_onset(indicator: Indicator) -> Onset | None:
    """The onset of wear in the current life, if it can be told yet."""
    problem = scaled(indicator, most=0)
    if isinstance(problem, str):
        return None
    found = first_alarm(problem.y, problem.fixed)
    if found is None:
        return None
    life = indicator.since_replaced()
    at = life.at[np.isfinite(life.value)]
    begin, told = (float(at[min(k, len(at) - 1)]) for k in found)
    return Onset(begin, told)


def first_alarm(
    y: Float64[np.ndarray, " n"], fixed: Float64[np.ndarray, "n k"],
    false_alarms: float = FALSE_ALARMS,
) -> tuple[int, int] | None:  # fmt: skip
    """(begin, alarm) as rows; None without an alarm.

    Args:
        y: values, growing with wear.
        fixed: columns that foretell a calm value, a constant among them.
        false_alarms: per value.
    """
    n, k = fixed.shape
    if n <= k + FIRST:
        return None
    lean, limit = persistence(y, fixed), limit_of(false_alarms / MARGIN)
    begin, alarm = watch(y, fixed, lean, k + FIRST, scores(), STEP, limit, SHIFT)
    return (int(begin), int(alarm)) if alarm >= 0 else None


@cache
def scores() -> Float64[np.ndarray, "dofs knots"]:
    """Normal scores of Student values, per degrees of freedom; the last row serves all beyond."""
    knots = STEP * np.arange(-1200, 1201)
    chance = np.clip(scipy.special.stdtr(np.arange(1, 121)[:, None], knots), 1e-12, 1.0 - 1e-12)
    out: Float64[np.ndarray, "dofs knots"] = np.clip(scipy.special.ndtri(chance), -CUT, CUT)
    return out


def persistence(y: Float64[np.ndarray, " n"], fixed: Float64[np.ndarray, "n k"]) -> float:
    """How much a value leans on the one before, between 0 and 0.9, from the first `CALM` values.

    Steps of a series that leans by ρ are correlated by −(1 − ρ)/2. Steps, cut at three robust
    standard deviations, do not take a jump or the begin of wear for persistence.
    """
    n = min(len(y), max(CALM, 4 * fixed.shape[1]))
    rest = y[:n] - fixed[:n, 1:] @ np.linalg.lstsq(fixed[:n], y[:n], rcond=None)[0][1:]
    steps = np.diff(rest)
    steps = steps - np.median(steps)
    reach = 3.0 * 1.4826 * float(np.median(np.abs(steps)))
    steps = np.clip(steps, -reach, reach)
    power = float(steps @ steps)
    if power <= 0.0:
        return 0.0
    found = 1.0 + 2.0 * float(steps[1:] @ steps[:-1]) / power
    return min(found, 0.9) if found > 2.0 / math.sqrt(n) else 0.0


@njit(exact=False, cache=True)
def watch(
    y: Any, fixed: Any, lean: float, first: int, score: Any, step: float, limit: float, shift: float
) -> Any:
    """(last row where the sum was zero, row of the alarm or −1)."""
    n, k = fixed.shape
    p = np.eye(k) * 1e8
    beta = np.zeros(k)
    square, dof, total, begin = 0.0, -float(k), 0.0, 0
    middle = (score.shape[1] - 1) // 2
    x = np.empty(k)
    for i in range(n):
        keep = lean if i > 0 else 0.0
        target = y[i] - (keep * y[i - 1] if i > 0 else 0.0)
        for j in range(k):
            x[j] = fixed[i, j] - (keep * fixed[i - 1, j] if i > 0 else 0.0)
        px = p @ x
        f = 1.0 + x @ px
        error = target - x @ beta
        new = error / math.sqrt(f)
        if i >= first and dof >= 1.0:
            spread = math.sqrt(max(square / dof, 1e-30))
            at = new / spread / step + middle
            row = min(int(dof), score.shape[0]) - 1
            at = min(max(at, 0.0), score.shape[1] - 1.001)
            low = int(at)
            u = score[row, low] + (at - low) * (score[row, low + 1] - score[row, low])
            total += u - shift
            if total <= 0.0:
                total, begin = 0.0, i + 1
            if total > limit:
                return begin, i
        if total <= 0.5 * limit:
            beta += px * error / f
            p -= np.outer(px, px) / f
            if dof >= 0.0:
                square += new * new
            dof += 1.0
    return begin, -1
