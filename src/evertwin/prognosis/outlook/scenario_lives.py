"""A scenario with all that it touches: the machine, its wear at a date, its lives, its docking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from evertwin.ahead.changes import Case, changed
from evertwin.ahead.spec import ScenarioSpec
from evertwin.ahead.whatif import WhatIf, beside, today
from evertwin.errors import UsageError
from evertwin.models.spec import ChangeSpec
from evertwin.prognosis.laws import Life, Workload
from evertwin.prognosis.laws.series.calendar import UNITS
from evertwin.prognosis.outlook.lives import ComponentLife
from evertwin.prognosis.outlook.prospect import Prospect
from evertwin.prognosis.outlook.workplan import Plan, past_cycles, plan_of, workload
from evertwin.signals.units import from_si, to_si
from evertwin.types import Json


def run_scenario(prospect: Prospect, scenario: ScenarioSpec) -> WhatIf:
    """A scenario beside today.

    Raises:
        UsageError: a change that this machine cannot have, or wear without what tells it.
        DataError: a path or recording that cannot be used.
    """
    basis = prospect.basis
    whole = scenario.horizon is None
    now = prospect.today if whole else today(basis, prospect.data, scenario.horizon)
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
    told, notes = _lives(prospect, lives, scenario)
    return replace(found, worn=worn, lives=told, notes=(*found.notes, *notes))


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
        quantiles = [one.course.value(after, p) for p in (0.025, 0.5, 0.975)]
        if one.rule.unit:  # the course is in it, a parameter in its own
            quantiles = [from_si(to_si(x, one.rule.unit), item.unit) for x in quantiles]
        ends, middle = sorted(quantiles[::2]), quantiles[1]
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
    prospect: Prospect, lives: tuple[ComponentLife, ...], scenario: ScenarioSpec
) -> tuple[Mapping[str, Mapping[str, Json]], tuple[str, ...]]:
    """Life of each component as it is, and with the scenario in all work from now on; notes."""
    found: dict[str, Mapping[str, Json]] = {}
    notes = []
    works = prospect.basis.setup.spec.work
    # without a plan a machine that is counted in time works all the time
    continuous = not works and prospect.rule.clock in UNITS
    plan: Plan | None = None
    for one in lives:
        if not isinstance(one.before, Life):
            found[one.component] = {**one.before.document(), "sentence": one.sentence}  # type: ignore[dict-item]
            continue
        plan = plan or plan_of(
            prospect.basis, prospect.today, works, scenario, continuous=continuous
        )
        past = past_cycles(prospect.rule, one.indicator) if works else 1.0
        try:
            work = workload(one.wears, plan, past)
        except UsageError as error:  # the simulation is worth telling without it
            notes.append(f"life of {one.component} is not told: {error}")
            continue
        found[one.component] = _beside(one, one.before.through(work, one.before.unit), work)
    return found, tuple(notes)


def _beside(one: ComponentLife, new: Life, work: Workload) -> Mapping[str, Any]:
    old = one.life
    assert isinstance(old, Life)
    rate = work.mean_rate(new.median) / one.rate if one.rate > 0.0 else 1.0
    return {
        "rate": rate, "baseline": old.document(), "with_scenario": new.document(),
        "sentence": (
            f"{old.median:.4g} -> {new.median:.4g} {new.unit} (80 %: {new.interval80[0]:.4g} … "
            f"{new.interval80[1]:.4g}), wears {rate:.3g} times as fast"
        ),
    }  # fmt: skip
