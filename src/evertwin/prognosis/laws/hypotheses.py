"""Looks: each family of hypotheses after its nodes closed in, with what the data say under each.

A look holds one family (`evertwin.prognosis.laws.families`) at its nodes with the posterior of
`bank` and the logarithm of evidence and prior. Hypotheses that the data rule out
are dropped, as a line here:

>>> from evertwin.prognosis.laws.indicator import Indicator, Limit
>>> from evertwin.prognosis.laws.scaled import scaled
>>> wear = Indicator.of("wear", "mm", Limit(2.0), np.arange(11.0), np.linspace(0.0, 1.0, 11) ** 2)
>>> looks = every_look(scaled(wear), ("linear", "power"), Fleet())
>>> [x.family.law for x in looks], len(looks[0].weight)
(['linear', 'power'], 0)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.prognosis.laws import jumps
from evertwin.prognosis.laws.bank import Posterior, evaluate
from evertwin.prognosis.laws.clocks import Clocks
from evertwin.prognosis.laws.families import Family, families
from evertwin.prognosis.laws.fleet import Fleet
from evertwin.prognosis.laws.scaled import Problem
from evertwin.types import Float64, Int64

PASSES = 5
"""Most rounds in which a family's nodes close in."""
KEPT = 11.0
"""Log evidence below the best at which a hypothesis is dropped."""
SCALES = 18.0
"""Logarithm of the range over which the noise's variance is even before any data."""
SMALL = 1e-3
"""Share of the probability below which a family is not looked at more sharply."""
RARE = 1e-4
"""Share of the probability below which a hypothesis is dropped after the first look."""


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
    problem: Problem, looks: Sequence[Look], share: Float64[np.ndarray, " h"], prior: Fleet
) -> tuple[Look, ...]:
    """Families that matter, on nodes over the part that holds the probability."""
    out, old, at = [], [], 0
    for x in looks:
        part = share[at : at + len(x.weight)]
        at += len(x.weight)
        if x.family.random or x.family.law in ("gamma", "linear") or part.sum() < SMALL:
            old.append(x.take(np.flatnonzero(part > RARE)))
            continue
        whole = np.zeros(len(x.family.first) * len(x.family.onset))
        whole[x.node] = part
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
        family,
        Clocks("linear", 0.0 * far, 0.0 * far),
        jumps.ALPHAS,
        certain,
        weight + np.log(SCALES),
        np.arange(n),
    )
