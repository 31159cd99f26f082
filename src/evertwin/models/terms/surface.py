"""A surface over two inputs, added to the first: whatever a form does not know, smoothly.

Bilinear between its nodes; outside, the border. Its prior is a Gaussian process over the nodes,
symmetric where the machine is: odd in its own channel and even in the other ("both"), odd under
reversal of both ("odd"), or neither.
"""

from __future__ import annotations

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
)
from evertwin.models.terms.kernel import cell, placed
from evertwin.models.terms.priors import LENGTHS, NOISES, modes, product, reached
from evertwin.models.terms.rows import Rows
from evertwin.types import Bool, Vector

GRID = 21
"""Nodes along each channel."""


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """u + bilinear interpolation of the nodes p[i·n2 + j]."""
    own = placed(at)
    n2 = own.size2
    i, a = cell(u[own.channel], grid, 0, own.size)
    j, b = cell(u[own.source], grid, own.size, n2)
    low = p[i * n2 + j] * (1.0 - b) + p[i * n2 + j + 1] * b
    high = p[(i + 1) * n2 + j] * (1.0 - b) + p[(i + 1) * n2 + j + 1] * b
    u[own.channel] = u[own.channel] + low * (1.0 - a) + high * a
    return 0


class Surface(GridTerm):
    """See the module.

    >>> flat = Term("surface", "v", "w", levels=(0.0, 1.0), levels2=(0.0, 1.0))
    >>> KIND.say(flat, (0.0, 0.0, -0.02, 0.01), "m/s", {})
    'v: surface over v and w, up to 0.02 m/s'
    """

    kind, pairs, rescored = "surface", True, False
    functions = Functions(before)

    def check(self, term: Term, model: Model) -> None:
        super().check(term, model)
        for grid in (term.levels, term.levels2):
            rising(self.kind, term.channel, grid)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        places = ((i, j) for i in range(len(term.levels)) for j in range(len(term.levels2)))
        return [Parameter(f"{i}.{j}", 0.0, unit) for i, j in places]

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        for channel in rows.chosen:
            for source in rows.others(channel):
                own, other = (_even(rows.inputs(name)) for name in (channel, source))
                n, span = GRID * GRID, 3.0 * rows.size(channel)
                yield Candidate(
                    Term(self.kind, channel, source, levels=own, levels2=other), FREE,
                    ((0.0,) * n,), (-span,) * n, (span,) * n, (0.02 * span,) * n,
                    replaces=("law", "coupling", "table"),
                )  # fmt: skip

    def reached(
        self, term: Term, u: Vector, source: Vector | None
    ) -> Bool[np.ndarray, "n numbers"]:
        """Nodes at either side of a value."""
        assert source is not None
        own, other = reached(u, np.array(term.levels)), reached(source, np.array(term.levels2))
        return np.asarray((own[:, :, None] & other[:, None, :]).reshape(len(u), -1))

    def priors(self, term: Term) -> Iterator[Prior]:
        """The more symmetric ones first, of several lengths."""
        for length in LENGTHS:
            own = modes(np.array(term.levels), length)
            other = modes(np.array(term.levels2), length)
            for rank, symmetry in enumerate(("both", "odd", "none")):
                name = f"symmetry {symmetry}, length {length:g}"
                yield Prior(product(own, other, symmetry), NOISES, length, rank, name)

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        worst, both = max(abs(v) for v in values), f"{term.channel} and {term.source}"
        return f"{term.channel}: surface over {both}, up to {worst:.3g} {unit}"


def _even(u: Vector) -> tuple[float, ...]:
    """Levels from the largest value one way to the same the other way."""
    most = float(np.abs(u).max())
    return tuple(float(v) for v in np.linspace(-most, most, GRID))


KIND = Surface()
