"""Weights from effect and drift; what their schedule saves and costs, measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.engineering.choice import questions
from evertwin.engineering.criticality import YEAR
from evertwin.engineering.level import LevelChoice
from evertwin.engineering.mapping import links
from evertwin.engineering.weights import Measured, Weighed, measure, weigh
from evertwin.tuning import solve

from .axis import posed

pytestmark = pytest.mark.usefixtures("quick")
NAMES = ("guide.Fv", "table.mass")


def weighed(interval: float) -> tuple[Weighed, Measured]:
    breakdown, _, problem = posed()
    levels = {c.name: LevelChoice(c.name, "grey", "grey", "") for c in breakdown.components}
    asked = questions(breakdown, levels, links(problem))
    own = replace(problem, editable=NAMES)
    fit, needs = solve(own), replace(breakdown.requirements, interval=interval)
    found = weigh(own, fit, asked, needs)
    return found, measure(own, fit, asked, found, needs)


def test_the_growth_is_the_drift_of_its_parameters() -> None:
    found, _ = weighed(YEAR / 40)
    _, _, problem = posed()
    own = replace(problem, editable=NAMES)
    fit = solve(own)
    j, y = own.jacobian(fit.values)[:, 0], own.rows.y[:, 0]
    moved = j * fit.values * np.array([0.5, 0.2]) / 40
    added = np.sqrt(np.mean(moved**2, axis=0))
    assert found.growth["tau1"] == pytest.approx(sum(added) / np.sqrt(np.mean(y**2)), rel=1e-6)


def test_a_longer_interval_asks_for_more_turns() -> None:
    rare, _ = weighed(YEAR / 60)
    often, _ = weighed(YEAR / 10)
    assert often.weights["guide.Fv"] > rare.weights["guide.Fv"]


def test_the_schedule_stays_inside_the_requirement_and_says_what_it_costs() -> None:
    found, measured = weighed(YEAR / 40)
    assert 0 < found.weights["guide.Fv"] < 1
    assert measured.count < measured.count_all
    assert measured.deviation["tau1"] < 0.05
    assert measured.deviation["tau1"] > measured.deviation_all["tau1"]
    assert measured.lost == pytest.approx(
        measured.deviation["tau1"] - measured.deviation_all["tau1"]
    )
    assert 0 < measured.simulations < measured.simulations_all


def test_without_schedule_an_output_would_leave_its_limit() -> None:
    """The planted drift is strong enough to matter: the measure is able to fail."""
    found, _ = weighed(YEAR / 40)
    breakdown, _, problem = posed()
    levels = {c.name: LevelChoice(c.name, "grey", "grey", "") for c in breakdown.components}
    asked = questions(breakdown, levels, links(problem))
    own = replace(problem, editable=NAMES)
    lazy = replace(found, weights=dict.fromkeys(found.weights, 0.01))
    needs = replace(breakdown.requirements, interval=YEAR / 40)
    assert measure(own, solve(own), asked, lazy, needs).deviation["tau1"] > 0.05
