"""The laws of wear as families of hypotheses, and looks: what the data say under each.

A look holds one family at its nodes with the posterior of `bank` and the logarithm of evidence and
prior. Hypotheses that the data rule out are dropped, as a line here:

>>> from evertwin.prognosis.laws.series.indicator import Indicator, Limit
>>> from evertwin.prognosis.laws.series.scaled import scaled
>>> wear = Indicator.of("wear", "mm", Limit(2.0), np.arange(11.0), np.linspace(0.0, 1.0, 11) ** 2)
>>> looks = every_look(scaled(wear), ("linear", "power"))
>>> [x.family.law for x in looks], len(looks[0].weight)
(['linear', 'power'], 0)

A family holds one law at many values of what is not linear in it: the exponent, or the ratio q of
process to noise. Its nodes start wide; after each look at the evidence they close in on
the part within `REACH` of the best, until `DENSE` nodes lie in the peak. Prior weights: the laws
alike, each exponent and each ratio evenly in its logarithm.

>>> families()[0].law
'linear'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.prognosis.laws.series.scaled import Problem
from evertwin.prognosis.laws.wear.bank import Posterior, evaluate
from evertwin.prognosis.laws.wear.clocks import Clocks, Form
from evertwin.types import Float64, Int64

FORMS: Mapping[str, Form] = {
    "power": "power", "exponential": "exponential", "saturating": "exponential",
    "cracking": "cracking",
}  # fmt: skip
"""The clock of a law; linear for any other."""
LAWS = (
    "linear", "exponential", "power", "saturating", "cracking", "wiener",
)  # fmt: skip
"""All laws."""
REACH = 9.0
"""Log evidence below the best at which a node no longer counts."""
PEAK = 3.0
DENSE = 6
"""Nodes that must lie within `PEAK` of the best."""
SHARP = 24
"""Nodes in the last look."""
LITTLE = 1e-3
"""Share of the largest at which a node of the last look begins."""
POWER = (0.3, 4.0)
"""Exponents of power laws."""
EXPONENT = (0.5, 8.0)
"""Exponent of exponential laws over the whole life."""
SATURATING = (0.5, 4.0)
"""Exponent of saturating laws over the whole life."""
CRACK = (0.3, 0.99)
"""Share of the time until a crack has no bound that a life is."""
YOUNG = 0.05
"""Share of its life below which a component is not asked for its exponent."""
RATIO = (0.3, 1e7)
"""Variance of the process over the observed span, in variances of the noise."""


WIDE: Mapping[str, tuple[float, float]] = {
    "power": POWER, "exponential": EXPONENT, "saturating": SATURATING,
    "cracking": CRACK,
}  # fmt: skip
"""Of each bent law: its exponent, over the whole life but for power laws."""


class Family(NamedTuple):
    """One law on nodes over the logarithm of its exponent or ratio.

    >>> Family("power", np.log([1.0, 2.0])).hypotheses()[0].shape
    array([1., 2.])
    """

    law: str
    first: Float64[np.ndarray, " i"]
    """log c, or log q of a Wiener process."""

    @property
    def random(self) -> bool:
        """Whether the law is a Wiener process."""
        return self.law == "wiener"

    def hypotheses(self) -> tuple[Clocks, Float64[np.ndarray, " h"]]:
        """(clocks, q) of all nodes."""
        size, quiet = np.exp(self.first), np.zeros(len(self.first))
        bent = self.law in WIDE
        shape = -size if self.law == "saturating" else size
        clocks = Clocks(FORMS.get(self.law, "linear"), shape if bent else quiet)
        return clocks, size if self.random else quiet

    def prior(self) -> float:
        """Logarithm of a node's prior weight, apart from that of the life itself."""
        wide = RATIO if self.random else WIDE.get(self.law)
        if wide is None:
            return 0.0
        low, high = wide
        return float(np.log(_step(self.first) / np.log(high / low)))

    def support(
        self, clocks: Clocks, age: Float64[np.ndarray, " m"]
    ) -> Float64[np.ndarray, "h m"] | float:
        """1 where the life that ends at ``age`` has an exponent that the prior allows."""
        if self.law not in WIDE or self.law == "power":
            return 1.0
        whole = np.abs(clocks.shape[:, None]) * age
        low, high = WIDE[self.law]
        allowed: np.ndarray = (whole >= low) & (whole <= high)
        return allowed.astype(np.float64)

    def closer(self, evidence: Float64[np.ndarray, " h"]) -> Family | None:
        """The family on finer nodes around the peak; None if it is fine enough."""
        first = _closer(self.first, evidence)
        return None if first is None else self._replace(first=first)

    def sharper(self, share: Float64[np.ndarray, " h"]) -> Family:
        """The family on even nodes over the part that holds the probability.

        Each exponent alone foretells the life sharply; between coarse nodes probability would be
        missing. q hardly moves the life, its nodes stay.
        """
        if self.random:
            return self
        return self._replace(first=_over(self.first, share))


def families(laws: Sequence[str] = LAWS) -> tuple[Family, ...]:
    """The families at their widest.

    Raises `UsageError` for a law that is not known.
    """
    unknown = sorted(set(laws) - set(LAWS))
    if unknown or not laws:
        raise UsageError(f"laws: expected some of {', '.join(LAWS)}, got {unknown or 'none'}")
    found = []
    for law in (law for law in LAWS if law in laws):
        low, high = WIDE.get(law, RATIO)
        least = low if law in ("power", "wiener") else YOUNG * low
        axis = np.linspace(np.log(least), np.log(high), 16 if law == "exponential" else 14)
        found.append(Family(law, np.zeros(1) if law == "linear" else axis))
    return tuple(found)


def _step(axis: np.ndarray) -> float:
    return float(axis[1] - axis[0]) if len(axis) > 1 else 1.0


def _over(axis: np.ndarray, share: np.ndarray) -> np.ndarray:
    if len(axis) < 2:
        return axis
    near = np.flatnonzero(share > LITTLE * share.max())
    low, high = max(near[0] - 1, 0), min(near[-1] + 1, len(axis) - 1)
    return np.linspace(axis[low], axis[high], SHARP)


def _closer(axis: np.ndarray, evidence: np.ndarray) -> np.ndarray | None:
    best = evidence.max()
    if len(axis) < 2 or np.count_nonzero(evidence > best - PEAK) >= DENSE:
        return None
    near = np.flatnonzero(evidence > best - REACH)
    low, high = max(near[0] - 1, 0), min(near[-1] + 1, len(axis) - 1)
    return np.linspace(axis[low], axis[high], max(len(axis), 2 * DENSE))


PASSES = 5
"""Most rounds in which a family's nodes close in."""
KEPT = 11.0
"""Log evidence below the best at which a hypothesis is dropped."""
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


def every_look(problem: Problem, laws: Sequence[str]) -> tuple[Look, ...]:
    """All families, closed in and pruned."""
    return kept([look(problem, family) for family in families(laws)])


def kept(looks: Sequence[Look]) -> tuple[Look, ...]:
    """Without hypotheses that the data rule out."""
    best = max((float(x.weight.max(initial=-np.inf)) for x in looks), default=0.0)
    return tuple(x.take(np.flatnonzero(x.weight > best - KEPT)) for x in looks)


def sharpened(
    problem: Problem, looks: Sequence[Look], share: Float64[np.ndarray, " h"]
) -> tuple[Look, ...]:
    """Families that matter, on nodes over the part that holds the probability."""
    out, old, at = [], [], 0
    for x in looks:
        part = share[at : at + len(x.weight)]
        at += len(x.weight)
        if x.family.random or x.family.law == "linear" or part.sum() < SMALL:
            old.append(x.take(np.flatnonzero(part > RARE)))
            continue
        whole = np.zeros(len(x.family.first))
        whole[x.node] = part
        out.append(at_nodes(problem, x.family.sharper(whole)))
    return (*old, *kept(out))


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
