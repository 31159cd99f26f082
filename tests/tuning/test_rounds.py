"""Tuning by rounds, schedules and ladders."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.fold import make_block
from evertwin.models import Parameters
from evertwin.signals import Layout
from evertwin.tuning import (
    Iteration,
    Problem,
    Schedule,
    Settings,
    held_out,
    solve,
    weights_from_growth,
)

TRUTH = np.r_[np.array([12.0, 14, 10, 3, 3, 2.5]), np.array([10.0, 10, 8, 2, 2, 2]), 0.02]


def task(axes: Any, measured: Any, seed: int = 0, start: float = 0.5) -> Problem:
    """Half the true Coulomb friction, 2 % noise."""
    rng = np.random.default_rng(seed)
    model = axes()
    values = TRUTH.copy()
    values[:6] *= start
    u = rng.normal(0, 0.5, size=(690, 6))
    block = measured(model, u, TRUTH, rng.normal(size=u.shape) * 0.02 * TRUTH[:6])
    names = tuple(f"Fc{k}" for k in range(6))
    return Problem(model, (block,), names, prior=model.parameters.with_values(values))


def test_relaxed_rounds_take_about_six_and_the_direct_solve_one(axes: Any, measured: Any) -> None:
    problem = task(axes, measured)
    done = Iteration().run(problem)
    assert done.fit.converged
    assert 4 <= len(done.rounds) <= 7
    assert max(done.fit.deviation_after) < 0.05
    axes_left = [6, *(6 - len(r.frozen) for r in done.rounds[:-1])]
    assert done.simulations == sum(axes_left)
    direct = solve(problem)
    assert direct.iterations == 1
    assert max(direct.deviation_after) < 0.05
    # Inside the limit is not the optimum: rounds stop early, the direct solve does not.
    assert np.abs(direct.values - TRUTH[:6]).max() < np.abs(done.fit.values - TRUTH[:6]).max()


def test_an_axis_inside_its_limit_is_frozen(axes: Any, measured: Any) -> None:
    done = Iteration().run(task(axes, measured))
    for k, name in enumerate(done.fit.outputs):
        at = [i for i, r in enumerate(done.rounds) if name in r.frozen]
        after = np.array([r.values[k] for r in done.rounds[at[0] :]])
        assert (after == after[0]).all()


def test_steps_grow_near_the_limit(axes: Any, measured: Any) -> None:
    slow = Iteration(near=0.4, band=3.0).run(task(axes, measured))
    quick = Iteration(near=1.0, band=3.0).run(task(axes, measured))
    assert quick.simulations < slow.simulations


def test_weights_decide_which_axes_are_tried(axes: Any, measured: Any) -> None:
    done = Iteration(weights={"t0": 0.5}).run(task(axes, measured))
    tried = ["t0" in r.tried for r in done.rounds[:4]]
    assert tried == [True, False, True, False]
    only = Iteration().run(task(axes, measured), due=("t1", "t2"))
    assert {n for r in only.rounds for n in r.tried} == {"t1", "t2"}
    assert only.fit["Fc0"] == 6.0


def test_rounds_that_do_not_suffice_are_said(axes: Any, measured: Any) -> None:
    done = Iteration(rounds=2).run(task(axes, measured))
    assert not done.fit.converged
    assert "still outside 5 %" in done.fit.message


def test_rounds_refuse_shared_parameters_and_bad_settings(axes: Any, measured: Any) -> None:
    class Shared(axes):  # type: ignore[misc]
        @property
        def columns(self) -> Any:
            return np.array([[0, 6], [0, 7], [2, 8], [3, 9], [4, 10], [5, 11]])

    problem = replace(task(axes, measured), model=Shared())
    with pytest.raises(UsageError, match="Fc0 acts on several outputs"):
        Iteration().run(problem)
    with pytest.raises(UsageError, match="relaxation"):
        Iteration(relaxation=0.0)


def test_rounds_work_on_a_model_without_regressor(friction: Any) -> None:
    u = np.linspace(-1, 1, 100)[:, None]
    block = make_block(t=np.arange(100), u=u, y=12 * np.sign(u) + 4 * u + 1)
    done = Iteration(limit=0.01).run(Problem(friction["one"], (block,), ("Fc",)))
    assert done.fit.converged
    assert done.fit["Fc"] == pytest.approx(12.0, abs=0.2)


def test_a_schedule_saves_simulations_and_keeps_every_axis_inside(axes: Any, measured: Any) -> None:
    growth = np.array([0.02, 0.02, 0.01, 0.006, 0.006, 0.004])
    names = tuple(f"t{k}" for k in range(6))
    weights = weights_from_growth(
        dict(zip(names, growth.tolist())), dict.fromkeys(names, 0.02), limit=0.05
    )
    counts = {}
    for label, schedule in {
        "weights": Schedule(weights), "equal": Schedule(dict.fromkeys(names, 1.0)),
    }.items():  # fmt: skip
        friction_now, values = TRUTH.copy(), TRUTH.copy()
        simulations, worst = 0, 0.0
        for turn in range(20):
            rng = np.random.default_rng(turn)
            friction_now[:6] *= 1 + growth
            model = axes(parameters=axes().parameters.with_values(values))
            u = rng.normal(0, 0.5, size=(300, 6))
            noise = rng.normal(size=u.shape) * 0.01 * friction_now[:6]
            block = measured(model, u, friction_now, noise)
            problem = Problem(model, (block,), tuple(f"Fc{k}" for k in range(6)))
            done = Iteration(0.02, relaxation=1.0).run(problem, due=schedule.due(turn))
            simulations += done.simulations
            values[:6] = done.fit.values
            worst = max(worst, *done.fit.deviation_after)
        counts[label] = simulations
        assert worst < 0.05
    assert counts["weights"] < 0.7 * counts["equal"]


def test_schedules_are_validated() -> None:
    with pytest.raises(UsageError, match="weight of a"):
        Schedule({"a": 0.0})
    assert Schedule({"a": 1 / 3}).count(9) == 3
    assert Schedule({"a": 1.0, "b": 0.5}).saving(20) == pytest.approx(0.25)


class Polynomial:
    """y = Σ c_n uⁿ."""

    inputs, outputs, states = Layout.of(u="1"), Layout.of(y="1"), Layout()

    def __init__(self, *powers: int) -> None:
        self.powers = np.array(powers)
        self.parameters = Parameters.of(**{f"c{n}": (1.0, "1") for n in powers})
        self.columns = np.arange(len(powers))[None, :]

    def initial(self, p: Any) -> Any:
        return np.zeros(0)

    def observe(self, x: Any, y: Any) -> Any:
        return x

    def regressor(self, x: Any, u: Any, dt: Any, p: Any) -> Any:
        return np.zeros_like(u), u[:, :, None] ** self.powers

    def simulate(self, x: Any, u: Any, dt: Any, p: Any) -> Any:
        return x, (u[:, :, None] ** self.powers * p).sum(axis=2)


law = Polynomial


def windows(form: Any, n: int = 4) -> tuple[Any, ...]:
    rng = np.random.default_rng(0)
    out = []
    for _ in range(n):
        u = rng.uniform(-1, 1, (25, 1))
        out.append(make_block(t=np.arange(25), u=u, y=form(u) + rng.normal(0, 0.05, (25, 1))))
    return tuple(out)


def test_a_fold_that_diverges_counts_as_infinitely_bad(robot: Any, run: Any) -> None:
    blocks = (run(robot, 1.0, 0), run(robot, 1.0, 1))
    fine = held_out(Problem(robot, blocks, horizon=1.0), settings=Settings(evaluations=20))
    assert fine[0] < 0.03
    wrecked = blocks[1]._replace(dt=np.full(300, 1e308))
    assert held_out(Problem(robot, (blocks[0], wrecked), horizon=1.0))[0] == np.inf
