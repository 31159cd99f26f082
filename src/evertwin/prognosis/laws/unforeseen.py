"""Whether the laws foretell the values at all, and what is said of the life where they do not.

The best law foretells each value from those before; over their own standard errors these errors are
alike and independent if the law holds. Against that stands a wandering explanation: errors that
lean on the one before, with a spread that is forgotten after 5 to 20 values. Both are judged by the
probability that they gave to each next error, before it came (prequential, Dawid 1984). The odds of
these, times `BEFOREHAND`, give the probability w that the wear follows none of the laws.

Then the component is only known to be at no special moment of its wear. Since wear makes more wear,
the life may end by that before it ends by the law; it does not end later:

    P(life > r) = P(life > r | laws)·(1 − w·F(r)),   F(r) = r/(r + u)

with u the time since the onset that was told, or else the age; a fleet of like machines gives F
where there is one.

>>> rng = np.random.default_rng(0)
>>> z = rng.standard_normal(200)
>>> probability(z, 2) < 0.1
True
>>> z[120:] *= 6.0
>>> probability(z, 2) > 0.9
True

Sources: Dawid, "Present position and potential developments: some personal views: statistical
theory: the prequential approach" (1984); Gott, "Implications of the Copernican principle" (1993);
West and Harrison, "Bayesian Forecasting and Dynamic Models" (1997), ch. 10, discounted variance.
"""

from __future__ import annotations

import numpy as np
import scipy

from evertwin.prognosis.laws.scaled import Problem
from evertwin.types import Float64

BEFOREHAND = 0.05
"""Probability, before any value, that wear follows none of the laws."""
KEEPS = (0.8, 0.9, 0.95, 1.0)
"""Share of what is known of the spread that is kept from one value to the next."""
LEANS = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75)
FIRST = 8
"""Values that the first comparison rests on, besides one per column."""
DIFFUSE = 1e6
"""Variance of levels and growth before any value, of values of order one."""
EXACT = 10.0 / DIFFUSE
"""Errors below it are those of a start that is not quite diffuse: they tell nothing."""


def errors(
    problem: Problem, clock: Float64[np.ndarray, " n"], q: float
) -> Float64[np.ndarray, " n"]:
    """Errors of one step under one hypothesis, over their standard errors up to one factor.

    Args:
        problem: the scaled series.
        clock: G at each value.
        q: variance of the process over G = 1 in units of the noise.
    """
    x = np.column_stack([problem.fixed, clock])
    walk = q * np.minimum(clock[:, None], clock)
    whole = np.diag(problem.omega * (1.0 + 1e-9)) + walk + DIFFUSE * (x @ x.T)
    out: Float64[np.ndarray, " n"] = np.linalg.solve(np.linalg.cholesky(whole), problem.y)
    return out


def probability(z: Float64[np.ndarray, " n"], columns: int) -> float:
    """Probability that no law holds, from the errors ``z`` of the best one.

    Args:
        z: errors of one step.
        columns: levels and growth that the law has free; as many first errors tell nothing.
    """
    start = columns + FIRST
    if len(z) <= start or np.sqrt(np.mean(np.square(z[start:]))) < EXACT:
        return BEFOREHAND
    tried = [foretold(z, columns, lean, keep) for lean in LEANS for keep in KEEPS
             if lean != 0.0 or keep < 1.0]  # fmt: skip
    odds = (
        float(scipy.special.logsumexp(tried)) - np.log(len(tried)) - foretold(z, columns, 0.0, 1.0)
    )
    return float(scipy.special.expit(odds + np.log(BEFOREHAND / (1.0 - BEFOREHAND))))


def foretold(z: Float64[np.ndarray, " n"], columns: int, lean: float, keep: float) -> float:
    """Log probability of the errors, each from those before: Student with a discounted spread."""
    new = z.copy()
    new[1:] -= lean * z[:-1]
    counted = (np.arange(len(z)) >= columns).astype(np.float64)
    before = np.stack([counted * new * new, counted])[:, :-1]
    square, known = scipy.signal.lfilter([1.0], [1.0, -keep], before, axis=1)[
        :, columns + FIRST - 1 :
    ]
    rest = new[columns + FIRST :]
    spread = np.maximum(square / known, 1e-300)
    log = (
        scipy.special.gammaln(0.5 * (known + 1.0))
        - scipy.special.gammaln(0.5 * known)
        - 0.5 * np.log(np.pi * known * spread)
    )
    return float(np.sum(log - 0.5 * (known + 1.0) * np.log1p(rest * rest / (known * spread))))


def ending(
    cdf: Float64[np.ndarray, " m"], sooner: Float64[np.ndarray, " m"], weight: float
) -> Float64[np.ndarray, " m"]:
    """The distribution function where life may end sooner than the laws say.

    >>> ending(np.array([0.0, 0.5]), np.array([0.5, 0.5]), 1.0)
    array([0.5 , 0.75])
    """
    out: Float64[np.ndarray, " m"] = 1.0 - (1.0 - cdf) * (1.0 - weight * sooner)
    return out
