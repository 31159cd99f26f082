"""A fit in which numbers that the rows do not tell stay as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.models.corrected.corrected import Corrected
from evertwin.tuning import Fit, Problem, solve, told_apart
from evertwin.tuning.form.collinear import leaning_on
from evertwin.tuning.intervals.identifiability import WEAK

NOT_TOLD = "no row tells them"
THE_SAME = "what stands for them tells the same"

CLEARLY = 1.2
"""Times the deviation that noise may leave more, of a number that the rows do not tell."""


def settled(problem: Problem) -> Fit:
    """The fit; where it would move what no row tells, one without these numbers.

    >>> import numpy as np
    >>> from evertwin.fold import make_block
    >>> from evertwin.machines.mobile import Omni
    >>> rng, u = np.random.default_rng(2), np.zeros((50, 3))
    >>> u[:, :2] = 0.1, 1e-4  # it hardly goes sideways
    >>> y = np.stack([0.008 * np.arange(1, 51), *np.zeros((2, 50))], axis=1)
    >>> rows = make_block(t=np.arange(50) * 10**8, u=u, y=y + rng.normal(0, 3e-3, (50, 3)))
    >>> settled(Problem(Omni(), (rows,), ("gain", "side_gain"))).names
    ('gain',)
    """
    fit = solve(problem)
    if len(problem.model.states) or any("collinear" in why for why in fit.reasons):
        fit = told_apart(problem, fit)
    alike = _alike(problem, fit)
    why, choices = (THE_SAME, alike) if alike else (NOT_TOLD, (_untouched(fit),))
    for stays in filter(None, choices):
        found = solve(problem.tuning(tuple(n for n in fit.names if n not in stays)))
        if clearly_worse(fit, found):  # where they were, the rows tell them
            continue
        if why == NOT_TOLD:
            found = leaning_on(problem, fit, found, stays)
        return replace(found, message=f"{found.message}; {', '.join(stays)} as before: {why}")
    return fit


def clearly_worse(fit: Fit, found: Fit) -> bool:
    """Does an output fit clearly worse by ``found``: do rows tell what it leaves as it was?"""
    pairs = zip(fit.residuals, found.residuals, strict=True)
    return any(b.rms_after > CLEARLY * a.rms_after for a, b in pairs)


def _alike(problem: Problem, fit: Fit) -> tuple[tuple[str, ...], ...]:
    """The model's numbers that no row tells from a correction's, which has taken their place; else
    those of the correction: behind a lag a machine changes at once, before it does not."""
    if not isinstance(problem.model, Corrected):
        return ()
    base = problem.model.model.parameters.names
    alike = [n for n, why in zip(fit.names, fit.reasons, strict=True) if "collinear" in why]
    own = tuple(name for name in alike if name in base)
    others = tuple(name for name in alike if name not in base)
    return (own, others) if own and others else ()


def _untouched(fit: Fit) -> tuple[str, ...]:
    """Numbers that noise drove to a bound; what ends at zero is an effect that is not there."""
    half = dict(zip(fit.names, (np.diff(fit.interval95)[:, 0] / 2.0).tolist(), strict=True))
    loose = tuple(n for n in fit.at_bound if half[n] > WEAK * abs(fit[n]) and fit[n] != 0.0)
    return loose if len(loose) < len(fit.names) else ()
