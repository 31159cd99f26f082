"""Numbers of the base model that are fitted beside every term.

What they explain a term has not to explain, and a term that they would make up for is not found
behind them: numbers that are wrong as configured hide it, and so do those tuned without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evertwin.correction.evidence import Evidence, mean_deviation
from evertwin.correction.numbers.fitting import refit
from evertwin.correction.stack import Stack

MOST = 8
"""Of more of them none is: a search would take too long."""
LITTLE, MUCH = 1e-4, 0.1
"""Shares of a number that are a probe, and considerable; of one that is zero, of what moves the
residuals by as much."""


def few_numbers(names: Sequence[str]) -> bool:
    """Are there some, and few enough?

    >>> few_numbers(()), few_numbers(("mass",))
    (False, True)
    """
    return 0 < len(names) <= MOST


def own_numbers(
    stack: Stack, evidence: Evidence, names: Sequence[str]
) -> tuple[tuple[int, float, float, float], ...]:
    """Place, bounds and size of a considerable change of each that moves anything.

    Args:
        names: of the base model's numbers that may be tuned.

    >>> from evertwin.correction.evidence import gather
    >>> from evertwin.fold import make_block
    >>> from evertwin.machines.mobile import Robot1D
    >>> u = np.ones((9, 1))
    >>> rows = make_block(t=np.arange(9) * 10**9, u=u, y=1.1 * u.cumsum()[:, None])
    >>> seen = gather(Robot1D(), (rows,), 2.0)
    >>> own_numbers(Stack(Robot1D(), (1.0,)), seen, ("gain",))[0][::3]
    (0, 0.1)
    """
    if not few_numbers(names):
        return ()
    found, now = [], evidence.residual(stack.model, stack.p)
    for place in stack.base.parameters.indices(names).tolist():
        item, p = stack.base.parameters.items[place], stack.p
        value, step = float(p[place]), LITTLE * (abs(p[place]) or 1.0)
        p[place] += step
        moved = np.sqrt(np.mean((evidence.residual(stack.model, p) - now) ** 2)) / step
        if moved > 0.0:
            size = MUCH * abs(value) or MUCH / moved
            found.append((place, item.low, item.high, float(size)))
    return tuple(found)


def unmoved(best: Stack, before: Stack, evidence: Evidence) -> Stack:
    """With the numbers as they were, where the terms alone leave hardly more: of one number Akaike
    asks for 1/n of the deviation of n segments."""
    if not best.tuned or not best.parts:
        return best
    bare = refit(replace(best, inner=before.inner, tuned=()), evidence).stack
    mean = [
        mean_deviation(evidence.deviations(evidence.residual(one.model, one.p)))
        for one in (bare, best)
    ]
    return bare if mean[0] <= (1.0 + len(best.tuned) / evidence.segments) * mean[1] else best
