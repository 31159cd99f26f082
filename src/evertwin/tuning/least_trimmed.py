"""Numbers that most rows agree on: least trimmed squares where outputs are linear in some.

Least squares follow a burst of wrong values as far as it is large. Concentration steps do not: a
solve, then another on the rows that it explains best, until these stay the same (P. Rousseeuw and
K. Van Driessen, 2006). They begin with all rows, and end well while a fifth of these is wrong.
"""

from __future__ import annotations

import numpy as np

from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.solver import closed
from evertwin.types import ParameterVector

KEPT = 0.7
"""Share of each output's rows that a step goes on with."""
STEPS = 20
"""At most; on sound rows the third or fourth changes nothing any more."""


def trimmed(problem: Problem) -> ParameterVector:
    """All parameters: what outputs are linear in as most rows have it, the rest as it was.

    Of a model with states, or one that gives no regressor, the problem's own.

    >>> from evertwin.fold import make_block
    >>> from evertwin.machines.drive import DriveForce
    >>> v = np.sin(np.arange(200) / 9)
    >>> force = 3 * v
    >>> force[80:100] *= 1000
    >>> rows = make_block(range(200), np.stack([v, 0 * v], axis=1), force[:, None])
    >>> problem = Problem(DriveForce(), (rows,), ("Fv",))
    >>> trimmed(problem)[problem.places].round(3).tolist()
    [3.0]
    """
    columns = getattr(problem.model, "columns", np.zeros(0))
    acting = set() if len(problem.model.states) else set(columns.ravel().tolist())
    pairs = zip(problem.names, problem.places.tolist(), strict=True)
    problem = problem.tuning(tuple(name for name, place in pairs if place in acting))
    if not problem.linear:
        return problem.full(problem.start)[: len(problem.model.parameters)]
    known = np.isfinite(problem.first)
    last, outputs, kept = (KEPT * (known.sum(axis=0) - 1)).astype(int), range(known.shape[1]), known
    for _ in range(STEPS):
        values = closed(problem, kept)[0]
        left = np.where(known, np.abs(problem.residuals(values)), np.inf)
        best = known & (left <= np.sort(left, axis=0)[last, outputs])
        if np.array_equal(best, kept):
            break
        kept = best
    return problem.full(values)
