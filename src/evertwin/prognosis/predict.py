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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64
from scipy.special import stdtr

from evertwin.prognosis import jumps
from evertwin.prognosis.bank import Posterior, evaluate, without_growth
from evertwin.prognosis.clocks import Clocks
from evertwin.prognosis.fleet import Fleet
from evertwin.prognosis.indicator import Indicator
from evertwin.prognosis.laws import LAWS, Family, families
from evertwin.prognosis.life import Life, NotEnough, quantiles
from evertwin.prognosis.onset import find_onset
from evertwin.prognosis.passage import path, process
from evertwin.prognosis.problem import Problem, noise_of, scaled
from evertwin.prognosis.unforeseen import ending, errors, probability
from evertwin.prognosis.workload import Workload

__all__ = ["predict_life"]

PASSES = 5
"""Most rounds in which a family's nodes close in."""
KEPT = 11.0
"""Log evidence below the best at which a hypothesis is dropped."""
COARSE: Float64[np.ndarray, " m"] = np.concatenate([[0.0], np.logspace(-4.0, 3.0, 49)])
"""Remaining life, in ages, where the mixture is looked at first."""
FINE = 140
"""Nodes over the part that holds the probability."""
TAIL = 2e-4
SCALES = 18.0
"""Logarithm of the range over which the noise's variance is even before any data."""
FAR = 20.0
"""A median beyond so many ages is no answer: growth is not told from none."""

SMALL = 1e-3
"""Share of the probability below which a family is not looked at more sharply."""
RARE = 1e-4
"""Share of the probability below which a hypothesis is dropped after the first look."""

LASTING = 3
"""Values beyond the limit that end a life; a single one does not."""
SURE = 3.0
"""Standard deviations at which growth stands out."""

Density = Callable[[np.ndarray], np.ndarray]


class Look(NamedTuple):
    """One family after its nodes closed in.

    >>> Look._fields[0]
    'family'
    """

    family: Family
    clocks: Clocks
    q: Float64[np.ndarray, " h"]
    posterior: Posterior
    weight: Float64[np.ndarray, " h"]
    """Log of evidence and prior, apart from the life's own."""
    node: Int64[np.ndarray, " h"]
    """Which of the family's nodes."""

    def take(self, index: np.ndarray) -> Look:
        """Some of the hypotheses."""
        return Look(self.family, self.clocks.take(index), self.q[index],
                    self.posterior.take(index), self.weight[index], self.node[index])  # fmt: skip


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
    unknown: float
    """Probability that wear has not begun."""
    passed: float
    """Probability that the limit is passed already."""


def uninformed(age: np.ndarray) -> np.ndarray:
    """1/T²: any share of the life may have passed."""
    out: np.ndarray = 1.0 / (age * age)
    return out


def predict_life(
    indicator: Indicator, laws: Sequence[str] = LAWS, fleet: Fleet | None = None,
    ahead: Workload | None = None,
) -> Life | NotEnough:  # fmt: skip
    """The remaining life as a distribution, or what the data lack for one.

    Args:
        indicator: the history; only its current life counts.
        laws: laws that may hold, some of `LAWS`.
        fleet: what like machines tell.
        ahead: work planned from now on; None: as before. Without usage in the indicator its
            unit is the work of one unit of the clock so far.
    """
    problem = scaled(indicator)
    if isinstance(problem, str):
        return NotEnough(problem)
    onset = find_onset(indicator)
    worn = problem.age if onset is None else since(indicator, onset.begin)
    found = replace(from_problem(indicator, problem, laws, fleet, worn), onset=onset)
    if isinstance(found, NotEnough) and found.onset is not None:
        begun = f"; wear has begun at {found.onset.begin:g} {indicator.clock}"
        return replace(found, reason=found.reason + begun)
    if isinstance(found, NotEnough) or (indicator.usage is None and ahead is None):
        return found
    plan = ahead if ahead is not None else Workload.as_before(indicator)
    return found.through(plan, indicator.clock)


def from_problem(
    indicator: Indicator, problem: Problem, laws: Sequence[str], fleet: Fleet | None, worn: float
) -> Life | NotEnough:
    """The life on the law's own clock; ``worn`` is the time since wear began."""
    prior = fleet if fleet is not None else Fleet()
    density = density_of(prior, problem.age)
    looks = every_look(problem, laws, prior)
    if not looks:
        return NotEnough(f"values that one of the laws {', '.join(laws)} allows")
    rough = mixture(problem, looks, COARSE, density)
    if rough.passed > 0.5:
        return over(indicator, problem)
    looks = sharpened(problem, looks, rough, prior)
    found = mixture(problem, looks, fine_nodes(rough.cdf), density)
    half = float(np.interp(0.5, found.cdf, found.nodes)) if found.cdf[-1] > 0.5 else np.inf
    if half > FAR:
        beyond = float(np.median(problem.y[-LASTING:])) > problem.limit
        return over(indicator, problem) if beyond else too_calm(indicator, problem, found.laws)
    nodes = np.union1d(found.nodes, COARSE)
    cdf = ending(
        np.interp(nodes, found.nodes, found.cdf),
        sooner(prior, nodes * problem.age, problem.age, worn), unforeseen(problem, looks),
    )  # fmt: skip
    remaining = quantiles(nodes, prior.calibrated(cdf, 1.0 / (1.0 + half))) * problem.age
    return Life(indicator.clock, remaining, problem.now, found.laws)


def over(indicator: Indicator, problem: Problem) -> Life:
    """The answer where the limit is passed, with when: the first value that stayed beyond."""
    life = indicator.since_replaced()
    good = np.flatnonzero(np.isfinite(life.value))
    beyond = life.distance()[good] <= 0.0
    follows = np.append(beyond, np.ones(LASTING, dtype=np.bool_))
    stayed = np.all([follows[k : k + len(beyond)] for k in range(LASTING)], axis=0)
    at = float(life.at[good[int(np.argmax(stayed))]]) if stayed.any() else problem.now
    none = quantiles(np.zeros(1), np.ones(1))
    return Life(indicator.clock, none, problem.now, passed=at)


def since(indicator: Indicator, begin: float) -> float:
    """How long ago ``begin`` was on the law's own clock; above 0."""
    life = indicator.since_replaced()
    clock = life.at if life.usage is None else life.usage
    ago = float(clock[-1] - np.interp(begin, life.at, clock))
    return max(ago, float(clock[-1] - clock[0]) / len(clock))


def unforeseen(problem: Problem, looks: Sequence[Look]) -> float:
    """Probability that wear follows none of the laws; 0 where it grows in jumps, gamma's own."""
    best = max((x for x in looks if len(x.weight)), key=lambda x: float(x.weight.max()))
    if best.family.law == "gamma":
        return 0.0
    k = int(np.argmax(best.weight))
    clock = best.clocks.take(np.array([k])).at(problem.s)[0]
    return probability(errors(problem, clock, float(best.q[k])), problem.fixed.shape[1] + 1)


def sooner(
    prior: Fleet, r: Float64[np.ndarray, " m"], age: float, worn: float
) -> Float64[np.ndarray, " m"]:
    """P(life ends within ``r``) from nothing but the time that wear has lasted, or the fleet."""
    if not prior.knows_lives:
        out: Float64[np.ndarray, " m"] = r / (r + worn)
        return out
    beyond = max(prior.beyond(age), 1e-12)
    return np.array([1.0 - min(prior.beyond(age + x) / beyond, 1.0) for x in r])


def too_calm(indicator: Indicator, problem: Problem, laws: Mapping[str, float]) -> NotEnough:
    """The answer where growth is not told from none: how much of it would be.

    A straight line through n values with noise s has a growth known to s·√(12/n).
    """
    noise = noise_of(problem.y) * problem.scale
    if not np.ptp(problem.y) > 0.0:
        return NotEnough(f"values that change: all {len(problem.y)} are alike so far", laws=laws)
    enough = SURE * noise * np.sqrt(12.0 / len(problem.y))
    return NotEnough(
        f"growth that stands out: about {enough:.2g} {indicator.unit} towards the limit over as "
        f"many values as there are ({len(problem.y)})",
        f"no growth stands out of a scatter of {noise:.2g} {indicator.unit}",
        laws=laws,
    )


def density_of(prior: Fleet, age: float) -> Density:
    """Density of the life in ages now, given that it lasts until now."""
    if not prior.knows_lives:
        return uninformed
    beyond = max(prior.beyond(age), 1e-12)
    return lambda ages: prior.density(ages * age) * age / beyond


def fine_nodes(cdf: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, " fine"]:
    """Nodes over the part of `COARSE` that holds the probability."""
    before = int(np.flatnonzero(cdf <= TAIL)[-1])
    after = int(np.flatnonzero(cdf >= cdf[-1] * (1.0 - TAIL))[0])
    if after <= before:  # nearly all of it at infinity: anywhere may matter
        before, after = 1, len(COARSE) - 1
    low, high = COARSE[max(before, 1)], COARSE[after]
    return np.concatenate([[0.0], np.geomspace(low, max(high, low * 1.001), FINE)])


def every_look(problem: Problem, laws: Sequence[str], prior: Fleet) -> tuple[Look, ...]:
    """All families, closed in and pruned."""
    wanted = [law for law in laws if law != "gamma"]
    looks = [look(problem, family) for family in (families(wanted) if wanted else ())]
    jump = jump_look(problem) if "gamma" in laws else None
    return kept([*looks, jump] if jump is not None else looks, prior)


def kept(looks: Sequence[Look], prior: Fleet) -> tuple[Look, ...]:
    """With the fleet's weights of the laws, and without hypotheses that the data rule out."""
    known = [x._replace(weight=x.weight + log_share(prior, x.family.label)) for x in looks]
    best = max((float(x.weight.max(initial=-np.inf)) for x in known), default=0.0)
    return tuple(x.take(np.flatnonzero(x.weight > best - KEPT)) for x in known)


def log_share(prior: Fleet, law: str) -> float:
    """Logarithm of the law's prior weight, relative to all laws alike."""
    return float(np.log(len(prior.laws) * prior.laws[law])) if law in prior.laws else 0.0


def sharpened(
    problem: Problem, looks: Sequence[Look], rough: Mixture, prior: Fleet
) -> tuple[Look, ...]:
    """Families that matter, on nodes over the part that holds the probability."""
    out, old, at = [], [], 0
    for x in looks:
        share = rough.share[at : at + len(x.weight)]
        at += len(x.weight)
        if x.family.random or x.family.law in ("gamma", "linear") or share.sum() < SMALL:
            old.append(x.take(np.flatnonzero(share > RARE)))
            continue
        whole = np.zeros(len(x.family.first) * len(x.family.onset))
        whole[x.node] = share
        out.append(at_nodes(problem, x.family.sharper(whole)))
    return (*old, *kept(out, prior))


def look(problem: Problem, family: Family) -> Look:
    """One family, its nodes closing in on the evidence."""
    for _ in range(PASSES):
        found = at_nodes(problem, family)
        closer = family.closer(found.posterior.evidence)
        if closer is None:
            break
        family = closer
    return found


def at_nodes(problem: Problem, family: Family) -> Look:
    """One family at its nodes."""
    clocks, q = family.hypotheses()
    clock = clocks.at(problem.s)
    posterior = evaluate(problem.y, problem.omega, problem.fixed, clock, q, problem.base)
    return Look(
        family, clocks, q, posterior, posterior.evidence + family.prior(), np.arange(len(q))
    )  # fmt: skip


def mixture(
    problem: Problem, looks: Sequence[Look], nodes: Float64[np.ndarray, " m"], density: Density
) -> Mixture:
    """The posterior distribution of the remaining life on ``nodes``."""
    middle = 1.0 + 0.5 * (nodes[1:] + nodes[:-1])
    still = no_onset(problem)
    weight = np.concatenate([x.weight for x in looks])
    top = max(float(weight.max(initial=-np.inf)), still)
    mass = np.concatenate(
        [
            np.diff(first_passage(problem, x, nodes), axis=1)
            * life_prior(problem, x, middle, density)
            for x in looks
        ]
    )
    scale = np.exp(weight - top)
    part = scale[:, None] * mass
    none = float(np.exp(still - top))
    total = max(float(part.sum()) + none, 1e-300)
    share = part.sum(axis=1) / total
    labels = np.concatenate([np.full(len(x.weight), x.family.label) for x in looks])
    laws = {str(law): float(share[labels == law].sum()) for law in dict.fromkeys(labels)}
    ahead = np.concatenate([already(x.posterior, problem.limit) for x in looks])
    return Mixture(
        nodes,
        np.concatenate([[0.0], np.cumsum(part.sum(axis=0))]) / total,
        share,
        laws,
        none / total,
        float((scale * ahead).sum() / max(float(scale.sum()), 1e-300)),
    )


def first_passage(
    problem: Problem, x: Look, nodes: Float64[np.ndarray, " m"]
) -> Float64[np.ndarray, "h m"]:
    """P(passed within each node) per hypothesis."""
    if x.family.law == "gamma":
        grown, span = float(problem.y[-1] - problem.y[0]), float(problem.s[-1] - problem.s[0])
        left = problem.limit - float(problem.y[-1])
        return jumps.passed(x.q, grown, span, left, nodes)
    clock = x.clocks.at(1.0 + nodes)
    distance = clock - clock[:, :1]
    if x.family.random:
        return process(x.posterior, x.q, problem.limit, distance)
    return path(x.posterior, problem.limit, distance)


def already(posterior: Posterior, limit: float) -> np.ndarray:
    """P(level now is beyond the limit)."""
    spread = np.sqrt(np.maximum(posterior.cov[:, 0] * posterior.square / posterior.dof, 1e-300))
    out: np.ndarray = stdtr(posterior.dof, (posterior.now - limit) / spread)
    return out


def life_prior(
    problem: Problem, x: Look, age: Float64[np.ndarray, " m"], density: Density
) -> Float64[np.ndarray, "h m"]:
    """p(T)·|dT/db| at each age, the factor of the module."""
    if x.family.law == "gamma":  # its own prior is 1/T² already
        return np.tile(density(age) * age * age, (len(x.q), 1))
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


def jump_look(problem: Problem) -> Look | None:
    """The gamma process, its shapes in the place of q; None where it cannot be."""
    weight = jumps.evidence(problem.y, problem.s, problem.limit - float(problem.y[0]))
    if not np.isfinite(weight.max()):
        return None
    n = len(jumps.ALPHAS)
    far = np.full(n, problem.limit - float(problem.y[-1]))
    certain = Posterior(
        weight, 0.0 * far, problem.limit - far, 0.0 * far, np.zeros((n, 3)), 0.0 * far, 1.0
    )
    family = Family("gamma", np.zeros(1), np.zeros(1))
    return Look(
        family, Clocks.linear(n), jumps.ALPHAS, certain, weight + np.log(SCALES), np.arange(n)
    )
