"""The editable set on an axis where the right choice is known, and is not the welding arm's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.engineering.choice import Choice
from evertwin.engineering.study import Study, study
from evertwin.errors import ConfigError

from .axis import AXIS, TRUTH, posed

pytestmark = pytest.mark.usefixtures("quick")


@pytest.fixture(scope="module")
def found(quick: None) -> Study:
    breakdown, plan, problem = posed()
    return study(breakdown, problem, plan)


def by_name(one: Study) -> dict[str, Choice]:
    return {choice.name: choice for choice in one.chosen.choices}


@pytest.mark.slow
def test_what_drifts_and_matters_is_tuned(found: Study) -> None:
    assert found.chosen.editable == ("guide.Fv", "table.mass")


def test_every_other_parameter_is_kept_with_its_reason(found: Study) -> None:
    choices = by_name(found)
    assert choices["guide.Fc"].verdict == "negligible"
    assert choices["guide.Fc"].share is not None
    assert choices["guide.Fc"].share < 0.01
    assert choices["motor.R"].verdict == "unseen"
    assert "cannot be observed" in choices["motor.R"].reason
    assert choices["motor.J"].verdict == "constant"
    assert choices["screw.lead"].verdict == "constant"
    assert "Sobol share" in choices["guide.Fv"].reason


def test_the_first_fit_recovers_the_planted_truth(found: Study) -> None:
    for name in found.chosen.editable:
        one = by_name(found)[name]
        assert one.value is not None
        assert one.sigma is not None
        # the Coulomb force is kept 0.5 N off: that goes into the others
        assert one.value == pytest.approx(TRUTH[name], rel=0.02)


def test_the_model_says_which_signal_sees_what(found: Study) -> None:
    seen = {link.parameter: [s.signal for s in link.signals] for link in found.links}
    assert seen["guide.Fv"] == ["tau1"]
    assert seen["motor.R"] == []
    made = {v.component: v.share for v in found.virtual}
    assert made["guide"] > 0.5


def test_slow_motion_turns_the_choice_round() -> None:
    """The same file on a machine that creeps: Coulomb friction is all there is."""
    text = AXIS.replace("Fc = { value = 2", "Fc = { value = 30").replace(
        "Fv = { value = 60", "Fv = { value = 1"
    )
    breakdown, plan, problem = posed(text)
    (rows,) = problem.windows
    u = rows.u * [0.05, 0.0025]
    p = problem.parameters.with_values(
        {"guide.Fc": 30.0, "guide.Fv": 1.0, "table.mass": 1.0}
    ).values
    _, y = problem.model.simulate(problem.model.initial(p), u, rows.dt, p)
    noise = 0.3 * np.random.default_rng(4).standard_normal(y.shape)
    slow = replace(problem, windows=(rows._replace(u=u, y=y + noise),))
    assert study(breakdown, slow, plan).chosen.editable == ("guide.Fc",)


def test_of_two_that_cannot_be_told_apart_one_is_tuned() -> None:
    twin = AXIS.replace('name = "table"', 'name = "rail"\nlike = "rubs"\n'
        'wear = [{ effect = "dirt", parameters = ["Fv"], drift = 0.4 }]\n'
        'parameters = { Fv = { value = 30, unit = "Ns/m" } }\n'
        '[[system.component]]\nname = "table"')  # fmt: skip
    breakdown, plan, problem = posed(twin)
    choices = by_name(study(breakdown, problem, plan))
    assert choices["guide.Fv"].editable
    assert choices["rail.Fv"].verdict == "indistinct"
    assert "not identifiable" in choices["rail.Fv"].reason


def test_the_engineer_goes_before_what_is_proposed() -> None:
    first = 'override = { editable = true, weight = 0.25, reason = "R1" }'
    second = 'override = { editable = false, reason = "R2" }'
    text = AXIS.replace("Fc = { value = 2,", f"Fc = {{ value = 2, {first},")
    text = text.replace("mass = { value = 8,", f"mass = {{ value = 8, {second},")
    breakdown, plan, problem = posed(text)
    found = study(breakdown, problem, plan)
    assert found.chosen.editable == ("guide.Fc", "guide.Fv")
    assert by_name(found)["table.mass"].reason == "overridden: R2"
    assert found.weighed is not None
    assert found.weighed.weights["guide.Fc"] == 0.25
    assert found.weighed.reasons["guide.Fc"].endswith("overridden to 0.25: R1")


def test_what_is_inside_a_black_box_is_not_tuned() -> None:
    text = AXIS.replace(
        'name = "guide"', 'name = "guide"\noverride = { level = "black", reason = "-" }'
    )
    breakdown, plan, problem = posed(text)
    choices = by_name(study(breakdown, problem, plan))
    assert choices["guide.Fv"].verdict == "black"
    assert choices["table.mass"].editable


def test_a_first_fit_finds_initial_values() -> None:
    text = AXIS.replace("mass = { value = 8, unit", 'mass = { source = "experiment", unit')
    breakdown, plan, problem = posed(text)
    found = study(breakdown, problem, plan)
    assert found.identified is not None
    (mass,) = found.identified.found
    assert mass.value == pytest.approx(10.0, abs=4 * mass.sigma + 0.05)
    assert found.identified.after["tau1"] < found.identified.before["tau1"]


def test_a_pattern_without_match_is_told() -> None:
    breakdown, plan, problem = posed(AXIS.replace("accuracy = 0.05", 'identify = ["links.*"]'))
    with pytest.raises(ConfigError, match="no parameter matches 'links"):
        study(breakdown, problem, plan)


def test_the_record_is_plain(found: Study) -> None:
    content = found.to_dict()
    assert content["schema"] == "evertwin.engineer/1"
    assert list(content["editable"]) == ["guide.Fv", "table.mass"]  # type: ignore[arg-type]
    assert content["requirements"]["met"]["accuracy"] is True  # type: ignore[index,call-overload]
