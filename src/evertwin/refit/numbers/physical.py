"""What physics allows of a candidate, asked as validation asks: friction resists.

A fit whose friction gives power out somewhere on its rows is repeated with the numbers that do so
held at zero or above. Where that explains as much, the rows did not tell these numbers from others
(a joint that moves one way only trades dry friction for an offset); where it explains less, the
numbers have ended on a bound, which says that the form is wrong. What still gives power out, since
its numbers may not be tuned, is refused: it is neither tried nor promoted.

A term that a fit turns round, such as a Stribeck peak that would stick less at rest than it slides,
is held at zero, too. It may stay out of the law, so its bound says nothing of the form.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from evertwin.anomaly.verdict import Rule
from evertwin.machines.friction.resisting import pushes, rubbed, within
from evertwin.models import Model, Parameters
from evertwin.setup.friction_law import Laddered
from evertwin.signals.units import compatible
from evertwin.tuning import Fit, Problem
from evertwin.tuning.intervals.fit import Amend
from evertwin.types import ParameterVector

PASSIVE = ("kg", "kg*m^2", "N*s/m", "N*m*s", "J/K", "W/K", "ohm", "s")
"""Units of masses, inertias, frictions, capacities, conductances, resistances and times: what is
above zero has no such machine below it, whatever the bounds say of a model of one's own."""

PRODUCTS = ("Ixy", "Ixz", "Iyz")
"""Of inertia: a body has them on either side of zero."""

HOLDS = 3
"""Times that bodies are held, each with what they leave to others."""


def physically(
    problem: Problem, tune: Callable[[Problem], tuple[Fit, dict[str, Any]]]
) -> tuple[Fit, dict[str, Any]]:
    """A fit, repeated with bounds where its friction would give power out."""
    free, more = tune(problem)
    highest = dict(zip(problem.names, problem.bounds[1].tolist(), strict=True))
    fit, held = free, dict[str, str]()
    turned = set[str]()
    while True:
        wrong, other = pushes(problem.model, fit.p, problem.windows), _turned(problem, fit)
        new = {name: f"{push.name} gives power out" for push in wrong for name in push.negative}
        new = {
            name: why
            for name, why in (new | other).items()
            if name in problem.names and name not in held and highest[name] >= 0.0
        }
        if not new:
            break
        held, turned = held | new, turned | set(other)
        fit, more = tune(replace(problem, prior=_resisting(problem.parameters, held)))
    if held:
        # a term that is turned round stays out: without it the law is a simpler one
        alike = set(held) if _lost(free, fit) <= Rule().part else turned
        fit = _told(fit, held, alike)
    if wrong:
        fit = replace(fit, message=f"{fit.message}; not physical: {'; '.join(map(str, wrong))}")
    return fit, more


def passive(model: Model, p: ParameterVector, before: Mapping[str, float]) -> str:
    """Numbers that no machine has below zero and that fell below it, in words; empty: none did.

    Of friction it is the sum of its terms that resists: one of them may be below zero. So may a
    body's product of inertia.

    Args:
        model: of a candidate, with ``p``, (np,).
        before: what was above zero may not fall below.
    """
    drives = rubbed(model, within(model.inputs), within(model.outputs), p)
    terms = {name for drive in drives for name in drive.coefficients}
    return ", ".join(
        f"{item.name} {value:.3g} {item.unit}"
        for item, value in zip(model.parameters, p.tolist(), strict=True)
        if item.name not in terms
        and item.name.rpartition(".")[2] not in PRODUCTS
        and value < 0.0 < before.get(item.name, 0.0)
        and any(compatible(item.unit, unit) for unit in PASSIVE)
    )


def embodied(
    problem: Problem, tune: Callable[[Problem], tuple[Problem, Fit, dict[str, Any]]]
) -> tuple[Problem, Fit, dict[str, Any]]:
    """A tuning without the masses and moments of bodies that would fall below zero: noise tells
    them, or they stand for another body's. They stay as they were, and the rest is tuned."""
    out = list[str]()
    problem, fit, rounds = tune(problem)
    for _ in range(HOLDS):
        below = _below(problem, fit)
        rest = tuple(name for name in problem.names if name not in below)
        if not below or not rest:
            break
        out += below
        problem, fit, rounds = tune(problem.tuning(rest))
    if out:
        said = f"{', '.join(out)} as before: below zero is no body"
        fit = replace(fit, message=f"{fit.message}; {said}")
    return problem, fit, rounds


def _below(problem: Problem, fit: Fit) -> tuple[str, ...]:
    start = dict(zip(problem.names, problem.start.tolist(), strict=True))
    return tuple(
        name
        for name, unit, value in zip(fit.names, fit.units, fit.values.tolist(), strict=True)
        if "." in name
        and name.rpartition(".")[2] not in PRODUCTS
        and value < 0.0 < start.get(name, 0.0)
        and any(compatible(unit, body) for body in PASSIVE[:2])
    )


def _turned(problem: Problem, fit: Fit) -> dict[str, str]:
    """Numbers below zero of terms that may stay out of the law, each an effect that physics knows
    one way only: what sticks at rest, what a load adds."""
    model, items = problem.model, problem.parameters
    optional = model.rungs() if isinstance(model, Laddered) else ()
    return {
        name: f"{rung.name} is no such effect"
        for rung in optional
        for name in rung.add
        if name in fit.names and items[name].resists and fit[name] < 0.0
    }


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


_LEAST = 1e-100
"""Noise whose square is still a number."""


def _lost(free: Fit, held: Fit) -> float:
    """Share of the first deviation that only the free numbers explain."""
    rows = np.array([r.rows for r in free.residuals], dtype=np.float64)
    known = (free.noise > _LEAST) & (rows > 0)  # of a fit that nothing told, it is next to nothing
    weight = rows / np.where(known, free.noise, 1.0) ** 2
    before = np.nansum(weight * np.square([r.rms_before for r in free.residuals]))
    left = [
        float(np.nansum(weight * np.square([r.rms_after for r in one.residuals])))
        for one in (free, held)
    ]
    return (left[1] - left[0]) / float(before) if before > 0 else 0.0


def _told(fit: Fit, held: dict[str, str], alike: Collection[str]) -> Fit:
    """What was held is weak, whatever its interval; ``alike``: whose bound does not matter."""
    on = [name for name in fit.names if name in held and fit[name] == 0.0]
    said = {fit.names.index(name): f"held at 0: below it {held[name]}" for name in on}
    weak = {k: "" if fit.verdict[k] == "not" else "weak" for k in said}
    fit = fit.amended({k: Amend(None, weak[k], (why,)) for k, why in said.items()})
    bound = tuple(name for name in fit.at_bound if not (name in alike and name in on))
    more = f"; {', '.join(on)} held at 0, where friction does not push" if on else ""
    return replace(fit, at_bound=bound, message=fit.message + more)
