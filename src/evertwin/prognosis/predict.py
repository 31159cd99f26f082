"""Prediction of the remaining life: all laws at once, weighted by how well they foresaw the data.

Each hypothesis (`evertwin.prognosis.laws`) gives the probability of the data and the distribution
of first passage. A planner looks at a component at some moment of its life, at no special one:
before any data its life T, in ages, has the density 1/T² beyond now (the share of life that has
passed is even between 0 and 1), or that of a fleet of like machines. The flat prior of the growth b
that the bank uses is turned into this one by the factor

    ρ(T) = p(T)·|dT/db| = p(T)·G(T)²/(D·G'(T))

with D the distance from the start to the limit. The no-onset hypothesis, level without growth, has
the prior weight that the onset lies still ahead; its life is not known, so its share of the
probability lies at infinity.

>>> from evertwin.prognosis.indicator import Limit
>>> rng = np.random.default_rng(0)
>>> t = np.arange(50.0)
>>> wear = Indicator.of("wear", "mm", Limit(1.0), t, 0.01 * t + 0.01 * rng.standard_normal(50))
>>> life = predict_life(wear)
>>> life.law in LAWS, 45.0 < life.median < 55.0
(True, True)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.special import stdtr

from evertwin.prognosis import jumps
from evertwin.prognosis.bank import Posterior, evaluate, without_growth
from evertwin.prognosis.clocks import Clocks
from evertwin.prognosis.indicator import Indicator
from evertwin.prognosis.laws import LAWS, Family, families
from evertwin.prognosis.life import Life, NotEnough, quantiles
from evertwin.prognosis.passage import path, process
from evertwin.prognosis.problem import Problem, scaled

__all__ = ["predict_life"]

PASSES = 5
"""Most rounds in which a family's nodes close in."""
KEPT = 14.0
"""Log evidence below the best at which a hypothesis is dropped."""
COARSE: Float64[np.ndarray, " m"] = np.concatenate([[0.0], np.logspace(-5.0, 3.0, 65)])
"""Remaining life, in ages, where the mixture is looked at first."""
FINE = 160
"""Nodes over the part that holds the probability."""
TAIL = 2e-4
SCALES = 18.0
"""Logarithm of the range over which the noise's variance is even before any data."""
FAR = 20.0
"""A median beyond so many ages is no answer: growth is not told from none."""

Density = Callable[[np.ndarray], np.ndarray]


class Look(NamedTuple):
    """One family after its nodes closed in."""

    family: Family
    clocks: Clocks
    q: Float64[np.ndarray, " h"]
    posterior: Posterior
    weight: Float64[np.ndarray, " h"]
    """Log of evidence and prior, apart from the life's own."""

    def take(self, index: np.ndarray) -> Look:
        """Some of the hypotheses."""
        return Look(self.family, self.clocks.take(index), self.q[index],
                    self.posterior.take(index), self.weight[index])  # fmt: skip


class Mixture(NamedTuple):
    """The distribution on nodes, and each law's share."""

    cdf: Float64[np.ndarray, " m"]
    laws: dict[str, float]
    unknown: float
    """Probability that wear has not begun."""
    passed: float
    """Probability that the limit is passed already."""


def uninformed(age: np.ndarray) -> np.ndarray:
    """1/T²: any share of the life may have passed."""
    out: np.ndarray = 1.0 / (age * age)
    return out


def predict_life(
    indicator: Indicator, laws: Sequence[str] = LAWS, density: Density = uninformed
) -> Life | NotEnough:
    """The remaining life as a distribution, or what the data lack for one.

    Args:
        indicator: the history; only its current life counts.
        laws: laws that may hold, some of `LAWS`.
        density: prior density of the whole life, in ages now, above 1.
    """
    problem = scaled(indicator)
    if isinstance(problem, str):
        return NotEnough(problem)
    looks = every_look(problem, laws)
    rough = mixture(problem, looks, COARSE, density)
    inside = np.flatnonzero((rough.cdf > TAIL) & (rough.cdf < rough.cdf[-1] * (1.0 - TAIL)))
    low = COARSE[max(inside[0] - 1, 1)] if len(inside) else COARSE[1]
    high = COARSE[min(inside[-1] + 1, len(COARSE) - 1)] if len(inside) else COARSE[-1]
    nodes = np.concatenate([[0.0], np.geomspace(low, max(high, low * 1.001), FINE)])
    found = mixture(problem, looks, nodes, density)
    if found.passed > 0.5:
        return Life(indicator.clock, quantiles(np.zeros(1), np.ones(1)), problem.now, found.laws)
    remaining = quantiles(nodes, found.cdf) * problem.age
    life = Life(indicator.clock, remaining, problem.now, found.laws)
    if life.median > FAR * problem.age:
        return NotEnough("growth that stands out", laws=found.laws)
    return life


def every_look(problem: Problem, laws: Sequence[str]) -> tuple[Look, ...]:
    """All families, closed in and pruned."""
    looks = [look(problem, family) for family in families([x for x in laws if x != "gamma"])]
    best = max(float(x.weight.max()) for x in looks)
    return tuple(x.take(np.flatnonzero(x.weight > best - KEPT)) for x in looks)


def look(problem: Problem, family: Family) -> Look:
    """One family, its nodes closing in on the evidence."""
    for _ in range(PASSES):
        clocks, q = family.hypotheses()
        clock = clocks.at(problem.s)
        posterior = evaluate(problem.y, problem.omega, problem.fixed, clock, q, problem.base)
        closer = family.closer(posterior.evidence)
        if closer is None:
            break
        family = closer
    return Look(family, clocks, q, posterior, posterior.evidence + family.prior())


def mixture(
    problem: Problem, looks: Sequence[Look], nodes: Float64[np.ndarray, " m"], density: Density
) -> Mixture:
    """The posterior distribution of the remaining life on ``nodes``."""
    age = 1.0 + nodes
    middle = 1.0 + 0.5 * (nodes[1:] + nodes[:-1])
    logs: list[np.ndarray] = []
    masses: list[np.ndarray] = []
    owners: list[str] = []
    beyond: list[np.ndarray] = []
    for x in looks:
        if not len(x.q):
            continue
        clock = x.clocks.at(age)
        distance = clock - clock[:, :1]
        passed = (
            process(x.posterior, x.q, problem.limit, distance)
            if x.family.law == "wiener"
            else path(x.posterior, problem.limit, distance)
        )
        mass = np.diff(passed, axis=1) * life_prior(problem, x, middle, density)
        masses.append(mass)
        logs.append(x.weight)
        owners += [x.family.label] * len(x.q)
        beyond.append(already(x.posterior, problem.limit))
    weight, law, mass = np.concatenate(logs), np.array(owners), np.concatenate(masses)
    ahead = np.concatenate(beyond)
    gamma = jump_look(problem, nodes, middle, density)
    if gamma is not None:
        weight = np.concatenate([weight, gamma[0]])
        mass = np.concatenate([mass, gamma[1]])
        law = np.concatenate([law, np.full(len(gamma[0]), "gamma")])
        ahead = np.concatenate([ahead, np.zeros(len(gamma[0]))])
    still = no_onset(problem)
    top = max(float(weight.max()), still)
    scale = np.exp(weight - top)
    part = scale[:, None] * mass
    none = float(np.exp(still - top))
    total = float(part.sum()) + none
    cdf = np.concatenate([[0.0], np.cumsum(part.sum(axis=0))]) / total
    share = part.sum(axis=1)
    names = {name: float(share[law == name].sum()) / total for name in dict.fromkeys(owners)}
    if gamma is not None:
        names["gamma"] = float(share[law == "gamma"].sum()) / total
    passed_now = float((scale * ahead).sum() / max(scale.sum(), 1e-300))
    return Mixture(cdf, names, none / total, passed_now)


def already(posterior: Posterior, limit: float) -> np.ndarray:
    """P(level now is beyond the limit)."""
    spread = np.sqrt(np.maximum(posterior.cov[:, 0] * posterior.square / posterior.dof, 1e-300))
    out: np.ndarray = stdtr(posterior.dof, (posterior.now - limit) / spread)
    return out


def life_prior(
    problem: Problem, x: Look, age: Float64[np.ndarray, " m"], density: Density
) -> Float64[np.ndarray, "h m"]:
    """p(T)·|dT/db| at each age, the factor of the module."""
    distance = np.maximum(problem.limit - x.posterior.level, 1e-3)[:, None]
    clock, slope = x.clocks.at(age), x.clocks.slope(age)
    factor = density(age) * clock * clock / (distance * np.maximum(slope, 1e-300))
    if x.family.label == "two-phase":
        factor = factor / age
    out: Float64[np.ndarray, "h m"] = factor * x.family.support(x.clocks, age)
    return out


def no_onset(problem: Problem) -> float:
    """Log weight of a level without growth: half of the two-phase law's prior lies ahead."""
    return without_growth(problem.y, problem.omega, problem.fixed) + float(np.log(0.5))


def jump_look(
    problem: Problem, nodes: Float64[np.ndarray, " m"], age: Float64[np.ndarray, " m"],
    density: Density,
) -> tuple[np.ndarray, np.ndarray] | None:  # fmt: skip
    """(log weights, masses) of the gamma process; None where it cannot be."""
    y, s = problem.y, problem.s
    start = problem.limit - float(y[0])
    weight = jumps.evidence(y, s, start)
    best = float(weight.max())
    if not np.isfinite(best):
        return None
    kept = np.flatnonzero(weight > best - KEPT)
    grown, span = float(y[-1] - y[0]), float(s[-1] - s[0])
    passed = jumps.passed(jumps.ALPHAS[kept], grown, span, problem.limit - float(y[-1]), nodes)
    return weight[kept] + np.log(SCALES), np.diff(passed, axis=1) * density(age) * age * age
