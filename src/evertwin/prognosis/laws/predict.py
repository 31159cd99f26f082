"""Prediction of the remaining life: all laws at once, weighted by how well they foresaw the data.

The hypotheses are looked at (`hypotheses`), mixed to one distribution of the first
passage (`mixture`), first roughly, then sharply where the probability lies, and
life may end sooner where the laws foretell badly (`unforeseen`). A fleet of like
machines corrects the outcome.

>>> from evertwin.prognosis.laws.indicator import Limit
>>> rng = np.random.default_rng(0)
>>> t = np.arange(50.0)
>>> wear = Indicator.of("wear", "mm", Limit(1.0), t, 0.01 * t + 0.01 * rng.standard_normal(50))
>>> life = predict_life(wear)
>>> life.law in LAWS, 45.0 < life.median < 55.0
(True, True)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from evertwin.prognosis.laws.families import LAWS
from evertwin.prognosis.laws.fleet import Fleet
from evertwin.prognosis.laws.hypotheses import Look, every_look, sharpened
from evertwin.prognosis.laws.indicator import Indicator
from evertwin.prognosis.laws.life import Life, NotEnough, quantiles
from evertwin.prognosis.laws.mixture import COARSE, density_of, fine_nodes, mixture
from evertwin.prognosis.laws.onset import find_onset
from evertwin.prognosis.laws.scaled import Problem, noise_of, scaled
from evertwin.prognosis.laws.unforeseen import ending, errors, probability
from evertwin.prognosis.laws.workload import Workload
from evertwin.types import Float64

FAR = 20.0
"""A median beyond so many ages is no answer: growth is not told from none."""
LASTING = 3
"""Values beyond the limit that end a life; a single one does not."""
SURE = 3.0
"""Standard deviations at which growth stands out."""


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
    if rough.passed > 0.5 or beyond_for_good(indicator):
        return over(indicator, problem)
    looks = sharpened(problem, looks, rough.share, prior)
    found = mixture(problem, looks, fine_nodes(rough.cdf), density)
    half = float(np.interp(0.5, found.cdf, found.nodes)) if found.cdf[-1] > 0.5 else np.inf
    if half > FAR:
        return too_calm(indicator, problem, found.laws)
    nodes = np.union1d(found.nodes, COARSE)
    cdf = ending(
        np.interp(nodes, found.nodes, found.cdf),
        sooner(prior, nodes * problem.age, problem.age, worn), unforeseen(problem, looks),
    )  # fmt: skip
    remaining = quantiles(nodes, prior.calibrated(cdf, 1.0 / (1.0 + half))) * problem.age
    return Life(indicator.clock, remaining, problem.now, found.laws)


def beyond_for_good(indicator: Indicator) -> bool:
    """Do the newest values lie beyond the limit, as many as end a life?

    Not where temperature, load or warm-up move them: the limit holds at the reference alone.
    """
    life = indicator.since_replaced()
    if life.covariates:
        return False
    apart = life.distance()[np.isfinite(life.value)]
    return len(apart) >= LASTING and bool(np.all(apart[-LASTING:] <= 0.0))


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
