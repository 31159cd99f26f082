"""A table of one input: what was commanded becomes what the table says.

Variants: the value of the nearest level (Müller, Jazdi, Weyrich, "Self-improving Models for the
Intelligent Digital Twin", table 1), or *linear*, between two levels. Outside the levels the
correction of the last one is kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from evertwin.models.contract import Model
from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import (
    FREE,
    Candidate,
    Functions,
    GridTerm,
    Intervals,
    Prior,
    rising,
    told,
)
from evertwin.models.terms.kernel import cell, placed
from evertwin.models.terms.priors import LENGTHS, NOISES, modes, reached
from evertwin.models.terms.rows import LEVELS, Rows, propose_levels
from evertwin.types import Bool, Vector


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """The table's value."""
    own = placed(at)
    v, last = u[own.channel], own.size - 1
    if math.isnan(v):
        return 0
    if v <= grid[0]:
        u[own.channel] = p[0] + (v - grid[0])
        return 0
    if v >= grid[last]:
        u[own.channel] = p[last] + (v - grid[last])
        return 0
    k, share = cell(v, grid, 0, own.size)
    if own.variant == 1:
        u[own.channel] = p[k] + share * (p[k + 1] - p[k])
    else:
        u[own.channel] = p[k] if share <= 0.5 else p[k + 1]
    return 0


class Table(GridTerm):
    """See the module.

    >>> KIND.say(Term("table", "v", levels=(0.0, 0.1)), (0.0, 0.07), "m/s", {})
    'v: table of 2 levels, changes by up to 0.03 m/s'
    >>> KIND.say(Term("table", "u", levels=(0.0, 0.1)), (0.0, 0.07), "1", {})
    'u: table of 2 levels, changes by up to 0.03'
    """

    kind, variants = "table", ("", "linear")
    functions = Functions(before)

    def check(self, term: Term, model: Model) -> None:
        super().check(term, model)
        rising(self.kind, term.channel, term.levels)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        return [Parameter(str(k), level, unit) for k, level in enumerate(term.levels)]

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        for channel in rows.chosen:
            u = rows.inputs(channel)
            if u.min() < u.max():
                given = propose_levels(u, LEVELS, rows.quantum).tolist()
                levels, n = tuple(float(v) for v in given), len(given)
                size = rows.size(channel)
                around = np.array(levels if rows.warm(channel) else (0.0,) * n)
                low, high = (around - 3.0 * size).tolist(), (around + 3.0 * size).tolist()
                yield Candidate(
                    Term(self.kind, channel, levels=levels), FREE, (levels,), tuple(low),
                    tuple(high), (0.05 * size,) * n,
                )  # fmt: skip

    def reached(
        self, term: Term, u: Vector, source: Vector | None
    ) -> Bool[np.ndarray, "n numbers"]:
        """Nodes at either side of a value."""
        return reached(u, np.array(term.levels))

    def priors(self, term: Term) -> Iterator[Prior]:
        """Levels apart; or a smooth course of some length."""
        yield Prior(np.eye(len(term.levels)), (1e-6,), 0.0, 0, "levels apart")
        for length in LENGTHS:
            own = modes(np.array(term.levels), length)
            smooth = own.vectors * np.sqrt(own.variance)
            yield Prior(smooth, NOISES, length, 0, f"length {length:g}")

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        worst = max(abs(v - level) for v, level in zip(values, term.levels, strict=True))
        most = told("", worst, unit, {}, ".3g")
        return f"{term.channel}: table of {len(values)} levels, changes by up to {most}"


KIND = Table()
