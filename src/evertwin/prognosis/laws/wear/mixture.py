"""The mixture: the distribution of the remaining life over all hypotheses, each with its share.

A planner looks at a component at some moment of its life, at no special one: before any data its
life T, in ages, has the density 1/T² beyond now (the share of life that has passed is even between
0 and 1). The flat prior of the growth b that the bank uses is
turned into this one by the factor

    ρ(T) = p(T)·|dT/db| = p(T)·G(T)²/(D·G'(T))

with D the distance from the start to the limit. The no-onset hypothesis, level without growth, has
the prior weight that the onset lies still ahead; its life is not known, so its share of the
probability lies at infinity.

>>> from evertwin.prognosis.laws.series.indicator import Indicator, Limit
>>> from evertwin.prognosis.laws.wear.hypotheses import every_look
>>> from evertwin.prognosis.laws.series.scaled import scaled
>>> rng = np.random.default_rng(0)
>>> t = np.arange(50.0)
>>> wear = Indicator.of("wear", "mm", Limit(1.0), t, 0.01 * t + 0.01 * rng.standard_normal(50))
>>> problem = scaled(wear)
>>> found = mixture(problem, every_look(problem, ("linear",)), COARSE)
>>> round(found.laws["linear"], 3), bool(found.cdf[-1] > 0.99)
(1.0, True)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.prognosis.laws.series.scaled import Problem, thinned
from evertwin.prognosis.laws.wear.bank import Posterior, evaluate, without_growth
from evertwin.prognosis.laws.wear.hypotheses import Family, Look, every_look, look
from evertwin.prognosis.laws.wear.passage import path, process
from evertwin.types import Float64

COARSE: Float64[np.ndarray, " m"] = np.concatenate([[0.0], np.logspace(-4.0, 3.0, 49)])
"""Remaining life, in ages, where the mixture is looked at first."""
FINE = 140
"""Nodes over the part that holds the probability."""
TAIL = 2e-4
TOWARDS, TRIES = (0.5, 40.0), 40
"""Exponents, over the age, of growth towards a level."""

LEANS = 0.2
"""Correlation of neighbours up to which they count as independent."""
FEWEST = 24
"""Averages that are kept at least."""


class Mixture(NamedTuple):
    """The distribution on nodes, and each law's share.

    >>> Mixture._fields[:2]
    ('nodes', 'cdf')
    """

    nodes: Float64[np.ndarray, " m"]
    """Remaining life, in ages."""
    cdf: Float64[np.ndarray, " m"]
    share: Float64[np.ndarray, " h"]
    """Probability of each hypothesis."""
    laws: dict[str, float]
    passed: float
    """Probability that the limit is passed already."""


def fine_nodes(cdf: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, " fine"]:
    """Nodes over the part of `COARSE` that holds the probability."""
    before = int(np.flatnonzero(cdf <= TAIL)[-1])
    after = int(np.flatnonzero(cdf >= cdf[-1] * (1.0 - TAIL))[0])
    if after <= before:  # nearly all of it at infinity: anywhere may matter
        before, after = 1, len(COARSE) - 1
    low, high = COARSE[max(before, 1)], COARSE[after]
    return np.concatenate([[0.0], np.geomspace(low, max(high, low * 1.001), FINE)])


def mixture(problem: Problem, looks: Sequence[Look], nodes: Float64[np.ndarray, " m"]) -> Mixture:
    """The posterior distribution of the remaining life on ``nodes``."""
    middle = 1.0 + 0.5 * (nodes[1:] + nodes[:-1])
    still = no_onset(problem)
    weight = np.concatenate([x.weight for x in looks])
    top = max(float(weight.max(initial=-np.inf)), still)
    mass = np.concatenate(
        [
            np.diff(first_passage(problem, x, nodes), axis=1) * life_prior(problem, x, middle)
            for x in looks
        ]
    )
    scale = np.exp(weight - top)
    part = scale[:, None] * mass
    none = float(np.exp(still - top))
    total = max(float(part.sum()) + none, 1e-300)
    share = part.sum(axis=1) / total
    labels = np.concatenate([np.full(len(x.weight), x.family.law) for x in looks])
    laws = {str(law): float(share[labels == law].sum()) for law in dict.fromkeys(labels)}
    ahead = np.concatenate([already(x.posterior, problem.limit) for x in looks])
    return Mixture(
        nodes,
        np.concatenate([[0.0], np.cumsum(part.sum(axis=0))]) / total,
        share,
        laws,
        float((scale * ahead).sum() / max(float(scale.sum()), 1e-300)),
    )


def first_passage(
    problem: Problem, x: Look, nodes: Float64[np.ndarray, " m"]
) -> Float64[np.ndarray, "h m"]:
    """P(passed within each node) per hypothesis."""
    clock = x.clocks.at(1.0 + nodes)
    distance = clock - clock[:, :1]
    if x.family.random:
        return process(x.posterior, x.q, problem.limit, distance)
    return path(x.posterior, problem.limit, distance)


def already(posterior: Posterior, limit: float) -> np.ndarray:
    """P(level now is beyond the limit)."""
    spread = np.sqrt(np.maximum(posterior.cov[:, 0] * posterior.square / posterior.dof, 1e-300))
    out: np.ndarray = scipy.special.stdtr(posterior.dof, (posterior.now - limit) / spread)
    return out


def life_prior(
    problem: Problem, x: Look, age: Float64[np.ndarray, " m"]
) -> Float64[np.ndarray, "h m"]:
    """p(T)·|dT/db| at each age, the factor of the module."""
    distance = np.maximum(problem.limit - x.posterior.level, 1e-3)[:, None]
    clock, slope = x.clocks.at(age), x.clocks.slope(age)
    factor = clock * clock / (age * age * distance * np.maximum(slope, 1e-300))
    out: Float64[np.ndarray, "h m"] = factor * x.family.support(x.clocks, age)
    return out


def no_onset(problem: Problem) -> float:
    """Log weight of a level without growth: half a law's."""
    return without_growth(problem.y, problem.omega, problem.fixed) + float(np.log(0.5))


def never(problem: Problem, laws: Sequence[str]) -> float:
    """P(growth tends to a level this side of the limit): no life ends there.

    Beside the laws as they are asked stands growth towards a level with any exponent, whether it
    passes the limit or not, with half a law's weight; and the same on top of a line, which does:
    run-in, and wear.
    """
    wide = Family("saturating", np.linspace(np.log(TOWARDS[0]), np.log(TOWARDS[1]), TRIES))
    problem = independent(problem, look(problem, wide))
    near, looks = look(problem, wide), every_look(problem, laws)
    over = np.column_stack([problem.fixed, problem.s]), np.append(problem.base, 1.0)
    lined = []
    for family in (wide, near.family):
        clocks, q = family.hypotheses()
        found = evaluate(problem.y, problem.omega, over[0], clocks.at(problem.s), q, over[1])
        lined.append(_whole(found.evidence + _even(family)))
    beside = [_whole(x.weight) for x in looks if x.family.law != "saturating" and len(x.weight)]
    rest = 1.0 / np.expm1(np.exp(near.family.first))
    passes = path(near.posterior, problem.limit, rest[:, None])[:, 0]
    own = near.posterior.evidence + _even(near.family) + np.log(0.5)
    whole = _whole(np.array([*own, *beside, max(lined), no_onset(problem)]))
    return float(np.exp(own - whole) @ (1.0 - passes))


def independent(problem: Problem, near: Look) -> Problem:
    """Averages of as many neighbours as lean on each other beside the best of some hypotheses.

    A process explains noise that lasts better than any level with independent noise does.
    """
    clock = near.clocks.at(problem.s)[int(np.argmax(near.posterior.evidence))]
    weight = 1.0 / np.sqrt(problem.omega)
    columns, y = np.column_stack([problem.fixed, clock]) * weight[:, None], problem.y * weight
    rest = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
    leans = float(np.clip(rest[1:] @ rest[:-1] / max(float(rest @ rest), 1e-300), 0.0, 1.0))
    many = max(int(len(y) * (1.0 - leans) / (1.0 + leans)), FEWEST)
    return thinned(problem, many) if leans > LEANS and many < len(y) else problem


def _even(family: Family) -> float:
    """Log prior of one of the family's nodes over `TOWARDS`."""
    return float(np.log((family.first[1] - family.first[0]) / np.log(TOWARDS[1] / TOWARDS[0])))


def _whole(weight: np.ndarray) -> float:
    """Logarithm of the sum of weights."""
    return float(scipy.special.logsumexp(weight))
