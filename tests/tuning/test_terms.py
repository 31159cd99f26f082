"""A ladder of terms: finds the planted ones, agrees with the ladder of whole models."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec as config
from evertwin.errors import ConfigError, UsageError
from evertwin.fold import make_block
from evertwin.machines.arm import Arm
from evertwin.machines.drive import Drive
from evertwin.tuning import Problem, held_out
from evertwin.tuning.terms import climb_terms


def recording(true: Arm, p: Any, seed: int, rows: int = 300) -> Any:
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1, 1, (rows, 18))
    y = true.simulate(np.zeros(0), u, np.full(rows, 0.01), p)[1]
    t = np.arange(rows) * 10**7
    return make_block(t=t, u=u, y=y + 0.3 * rng.normal(size=y.shape))


def planted() -> tuple[Arm, Problem]:
    arm = Arm.of("ur5_like", law="tanh+stribeck+root+load")
    true = {"Fc1": 8.0, "Fs1": 4.0, "Fc2": 9.0, "Fl2": 0.2, "Fc4": 3.0, "Fv4": 2.0, "Ia3": 1.0}
    p = arm.parameters.with_values(true).values
    windows = tuple(recording(arm, p, seed) for seed in range(4))
    return arm, Problem(arm, windows)


def test_planted_terms_are_found_on_their_own_joints() -> None:
    arm, problem = planted()
    ascent = climb_terms(problem, arm.rungs())
    assert ascent.taken == (("stribeck",), ("load",), (), (), (), ())
    assert "Fs1" in ascent.names and "Fl2" in ascent.names and "Fl1" not in ascent.names
    assert len(ascent.steps) == 18
    assert [arm.law_name(k, terms) for k, terms in enumerate(ascent.taken)][:3] == [
        "tanh+stribeck", "tanh+load", "tanh"
    ]  # fmt: skip


def test_the_sums_say_what_fits_and_predictions_say() -> None:
    arm, problem = planted()
    (first, *_), steps = problem.windows, climb_terms(problem, arm.rungs()).steps
    assert len(first.t) == 300
    plain = tuple(n for n in problem.names if not n.startswith(("Fs", "Fr", "Fl")))
    direct = held_out(replace(problem, editable=plain))
    assert steps[0].before == pytest.approx(float(direct[0]), rel=1e-6)


def test_only_rows_that_count_are_scored() -> None:
    arm, problem = planted()
    some = replace(problem, moving=arm.moving(0.02), only_moving=True)
    assert climb_terms(some, arm.rungs()).taken[:2] == (("stribeck",), ("load",))


def test_a_term_whose_place_a_later_one_takes_leaves_again() -> None:
    arm = Arm.of("ur5_like", law="tanh+spring+balance")
    p = arm.parameters.with_values({"Gs4": 6.0, "Gc4": 2.0}).values
    problem = Problem(arm, tuple(recording(arm, p, seed) for seed in range(4)))
    ascent = climb_terms(problem, arm.rungs())
    assert [(s.term, s.taken) for s in ascent.steps if s.output == "tau4"] == [
        ("spring", True), ("balance", True)
    ]  # fmt: skip
    assert ascent.taken == ((), (), (), ("balance",), (), ())


@pytest.mark.parametrize(("planted", "taken"), [(4.0, ("stribeck",)), (-4.0, ())])
def test_what_sticks_less_at_rest_is_no_stribeck_effect(planted: float, taken: Any) -> None:
    arm = Arm.of("ur5_like", law="tanh+stribeck")
    p = arm.parameters.with_values({"Fc1": 8.0, "Fs1": planted}).values
    problem = Problem(arm, tuple(recording(arm, p, seed) for seed in range(4)))
    assert climb_terms(problem, arm.rungs()).taken[0] == taken


def test_a_term_that_turns_another_round_joins_only_where_it_pays_alone() -> None:
    arm = Arm.of("ur5_like", law="tanh+stribeck+root")
    p = arm.parameters.with_values({"Fr1": 6.0, "Fv1": 1.0, "Fc2": 5.0, "Fs2": 3.0}).values
    problem = Problem(arm, tuple(recording(arm, p, seed) for seed in range(4)))
    assert climb_terms(problem, arm.rungs()[::-1]).taken[:2] == (("root",), ("stribeck",))


def test_misuse_is_refused() -> None:
    arm, problem = planted()
    with pytest.raises(UsageError, match="at least 2 windows"):
        climb_terms(replace(problem, windows=problem.windows[:1]), arm.rungs())
    started = replace(problem, prior=arm.parameters.with_values({"Fs1": 1.0}))
    with pytest.raises(UsageError, match="expected Fs1 to start at zero"):
        climb_terms(started, arm.rungs())


def test_a_term_that_nothing_excites_stays_out() -> None:
    arm, problem = planted()
    still = []
    for window in problem.windows:
        u = window.u.copy()
        u[:, 6] = 0.5  # joint 1 at one speed: its terms are one constant
        y = arm.simulate(np.zeros(0), u, window.dt, arm.parameters.values)[1]
        still.append(make_block(t=window.t, u=u, y=y))
    ascent = climb_terms(replace(problem, windows=tuple(still)), arm.rungs()[:3])
    assert ascent.taken[0] == ()
    assert not any(np.isfinite(step.after) and step.taken for step in ascent.steps)


def test_a_law_that_is_simulated_is_climbed_too() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(400) * 10**7
    force = np.repeat(rng.uniform(-60.0, 60.0, 20), 20)[:, None]
    plain, bent = Drive("sign+direction"), []
    for rich in (0.0, 60.0):
        true = {"mass": 10.0, "Fv": 40.0, "Fv_back": rich, "Fc": 5.0}
        p = plain.parameters.with_values(true).values
        windows = []
        for k in range(3):
            u = np.roll(force, 100 * k, axis=0)
            _, y = plain.simulate(plain.initial(p), u, np.full(400, 0.01), p)
            y += rng.normal(0.0, 1e-4, y.shape)
            windows.append(make_block(t, u, y))
        start = plain.parameters.with_values({"mass": 12.0, "Fv": 50.0, "Fc": 4.0})
        problem = Problem(plain, tuple(windows), prior=start)
        bent.append(climb_terms(problem, plain.rungs()).taken[0])
    assert bent == [(), ("direction",)]


def test_a_ladder_of_terms_that_the_law_lacks_is_refused_when_the_twin_is_opened() -> None:
    def spec(law: str) -> TwinSpec:
        model = config.ModelSpec("drive_force", options={"law": law})
        return TwinSpec("axis", model, tuning=config.TuningSpec(ladder=("stribek",)))

    with pytest.raises(ConfigError, match="no term 'stribek': did you mean 'stribeck'"):
        Twin(spec("sign+stribeck"))
    with pytest.raises(ConfigError, match="no term 'stribek': it has none that may stay out"):
        Twin(spec("sign"))
