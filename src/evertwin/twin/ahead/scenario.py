"""A scenario with all that it touches: the machine, its wear at a date, its lives, its docking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from evertwin.config.scenario import ChangeSpec, ScenarioSpec
from evertwin.errors import UsageError
from evertwin.prognosis import Life, NotEnough
from evertwin.twin.ahead.changes import Case, changed
from evertwin.twin.ahead.lives import ComponentLife, Prospect
from evertwin.twin.ahead.usage import under, wear
from evertwin.twin.ahead.whatif import WhatIf, beside, today
from evertwin.types import Json

__all__ = ["run_scenario"]


def run_scenario(prospect: Prospect, scenario: ScenarioSpec) -> WhatIf:
    """A scenario beside today.

    Raises:
        UsageError: a change that this machine cannot have, or wear without what tells it.
        DataError: a path or recording that cannot be used.
    """
    basis = prospect.basis
    now = today(basis, prospect.data, scenario.horizon)
    lives = tuple(
        prospect.life(rule, drawn=scenario.wear is not None) for rule in basis.setup.spec.indicator
    )
    worn = {} if scenario.wear is None else _worn(lives, scenario.wear, now.case)
    moved = {name: ChangeSpec(value=one["to"]) for name, one in worn.items()}
    case = changed(basis, now.case, ScenarioSpec("wear", parameters=moved)) if moved else now.case
    after = changed(basis, case, scenario)
    if moved:  # what a date leaves open is open in the simulation, unless the scenario says a value
        sigma = after.sigma.copy()
        for name, one in worn.items():
            if name not in scenario.parameters:
                at = after.model.parameters.index(name)
                sigma[at] = (one["high95"] - one["low95"]) / (2 * 1.96)
        after = replace(after, sigma=sigma)
    found = beside(basis, now, scenario, after)
    return replace(
        found, worn=worn, lives=_lives(lives, now.case, after, prospect.rule.clock)
    )  # fmt: skip


def _worn(
    lives: tuple[ComponentLife, ...], after: float, case: Case
) -> dict[str, dict[str, float]]:
    """Each parameter that an indicator follows, at the date.

    Raises:
        UsageError: no indicator's course is known.
    """
    found: dict[str, dict[str, float]] = {}
    for one in lives:
        name = one.rule.parameter
        if name is None or one.course is None:
            continue
        item = case.model.parameters[name]
        ends = sorted(one.course.value(after, p) for p in (0.025, 0.975))
        middle = one.course.value(after, 0.5)
        found[name] = {
            "from": float(case.p[case.model.parameters.index(name)]),
            "to": min(max(middle, item.low), item.high), "low95": ends[0], "high95": ends[1],
        }  # fmt: skip
    if not found:
        raise UsageError(
            "wear: no [[indicator]] of a parameter has a course that can be told yet: add one, or "
            "give the worn values under [parameters]"
        )
    return found


def _lives(
    lives: tuple[ComponentLife, ...], before: Case, after: Case, clock: str
) -> Mapping[str, Mapping[str, Json]]:
    """Life of each component as it is, and under the scenario's work from now on."""
    found: dict[str, Mapping[str, Json]] = {}
    for one in lives:
        if isinstance(one.life, NotEnough):
            found[one.component] = {**one.life.document(), "sentence": one.sentence}  # type: ignore[dict-item]
            continue
        rate = wear(one.rule, after) / max(wear(one.rule, before), 1e-300)
        if clock not in ("run", "cycle"):
            # the machine works all the time: shorter cycles are more cycles
            rate *= float(before.future.dt.sum()) / float(after.future.dt.sum())
        found[one.component] = _beside(one.life, under(one.life, rate), rate)
    return found


def _beside(old: Life, new: Life, rate: float) -> Mapping[str, Any]:
    return {
        "rate": rate, "baseline": old.document(), "with_scenario": new.document(),
        "sentence": (
            f"{old.median:.4g} -> {new.median:.4g} {new.unit} (80 %: {new.interval80[0]:.4g} … "
            f"{new.interval80[1]:.4g}), wears {rate:.3g} times as fast"
        ),
    }  # fmt: skip
