"""What physics allows of a candidate, asked as validation asks: friction resists.

A fit whose friction gives power out somewhere on its rows is repeated with the numbers that do so
held at zero or above. Where that explains as much, the rows did not tell these numbers from others
(a joint that moves one way only trades dry friction for an offset); where it explains less, the
numbers have ended on a bound, which says that the form is wrong. What still gives power out, since
its numbers may not be tuned, is refused: it is neither tried nor promoted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from evertwin.anomaly.verdict import Rule
from evertwin.machines.friction.resisting import pushes
from evertwin.models import Parameters
from evertwin.tuning import Fit, Problem

Tune: TypeAlias = Callable[[Problem], tuple[Fit, dict[str, Any]]]


def physically(problem: Problem, tune: Tune) -> tuple[Fit, dict[str, Any]]:
    """A fit, repeated with bounds where its friction would give power out."""
    free, more = tune(problem)
    highest = dict(zip(problem.names, problem.bounds[1].tolist(), strict=True))
    fit, held = free, dict[str, str]()
    while True:
        wrong = pushes(problem.model, fit.p, problem.windows)
        new = {
            name: push.name
            for push in wrong
            for name in push.negative
            if name in problem.names and name not in held and highest[name] >= 0.0
        }
        if not new:
            break
        held |= new
        fit, more = tune(replace(problem, prior=_resisting(problem.parameters, held)))
    if held:
        fit = _told(fit, held, _lost(free, fit) <= Rule().part)
    if wrong:
        fit = replace(fit, message=f"{fit.message}; not physical: {'; '.join(map(str, wrong))}")
    return fit, more


def _resisting(parameters: Parameters, held: dict[str, str]) -> Parameters:
    """The prior with these numbers at zero or above."""
    return Parameters(
        tuple(
            replace(item, low=max(item.low, 0.0), value=max(item.value, 0.0))
            if item.name in held
            else item
            for item in parameters
        )
    )


def _lost(free: Fit, held: Fit) -> float:
    """Share of the first deviation that only the free numbers explain."""
    rows = np.array([r.rows for r in free.residuals], dtype=np.float64)
    weight = rows / np.where((free.noise > 0) & (rows > 0), free.noise, 1.0) ** 2
    before = np.nansum(weight * np.square([r.rms_before for r in free.residuals]))
    left = [
        float(np.nansum(weight * np.square([r.rms_after for r in one.residuals])))
        for one in (free, held)
    ]
    return (left[1] - left[0]) / float(before) if before > 0 else 0.0


def _told(fit: Fit, held: dict[str, str], alike: bool) -> Fit:
    """What was held is weak, whatever its interval; ``alike``: and is no bound that matters."""
    words, reasons = list(fit.verdict), list(fit.reasons)
    on = [name for name in fit.names if name in held and fit[name] == 0.0]
    for name in on:
        k = fit.names.index(name)
        words[k] = "not" if words[k] == "not" else "weak"
        why = f"held at 0: below it {held[name]} gives power out"
        reasons[k] = "; ".join(filter(None, (reasons[k], why)))
    bound = tuple(name for name in fit.at_bound if not (alike and name in on))
    said = f"; {', '.join(on)} held at 0, where friction does not push" if on else ""
    return replace(
        fit, verdict=tuple(words), reasons=tuple(reasons), at_bound=bound,
        message=fit.message + said,
    )  # fmt: skip
