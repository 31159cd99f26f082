"""Nonlinear tuning: solvers against problems, bounds, divergence, outliers, cancelling."""

from __future__ import annotations

import signal
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from evertwin.engine import Pool
from evertwin.errors import ModelError, UsageError
from evertwin.fold import make_block
from evertwin.models import Compiled, FunctionModel, Parameter, Parameters
from evertwin.models.batch import Batch
from evertwin.signals import Channel, Layout
from evertwin.tuning import Far, Problem, Settings, solve
from evertwin.tuning.intervals.identifiability import connected
from evertwin.tuning.intervals.valleys import bends
from evertwin.tuning.search.nonlinear import least_squares
from planted.draws import first_of

P = np.array([3.0, 2.0, 0.02])


def test_every_solver_agrees_on_a_linear_problem(axes: Any, measured: Any) -> None:
    rng = np.random.default_rng(0)
    model, u = axes(1), rng.normal(size=(200, 1))
    problem = Problem(model, (measured(model, u, P, 0.1 * rng.normal(size=u.shape)),))
    closed = solve(problem)
    searched = least_squares(problem, Settings())
    np.testing.assert_allclose(searched.values, closed.values, rtol=1e-6)
    wide = replace(problem, editable=("Fc0", "Bm0", "width"), prior=_width(model, 0.02))
    mixed = solve(wide)
    plain = least_squares(wide, Settings())
    assert mixed.method == "variable projection"
    np.testing.assert_allclose(mixed.values[:2], plain.values[:2], rtol=1e-4)
    assert mixed.cost <= closed.cost * 1.02


def _width(model: Any, value: float) -> Parameters:
    return model.parameters.with_values({"width": value})


def test_variable_projection_finds_a_width_from_far_away(axes: Any, measured: Any) -> None:
    rng = np.random.default_rng(1)
    model, truth = axes(1), np.array([3.0, 2.0, 0.3])
    z = []
    for _ in range(25):
        u = rng.normal(size=(200, 1))
        block = measured(model, u, truth, 0.1 * rng.normal(size=u.shape))
        prior = _width(model, 0.1)
        fit = solve(Problem(model, (block,), ("Fc0", "Bm0", "width"), prior=prior))
        assert fit.converged
        z.append((fit.values - truth) / fit.sigma)
    assert 0.75 < np.sqrt(np.square(z).mean()) < 1.25


def test_a_gain_is_recovered_over_one_horizon(robot: Compiled, run: Any) -> None:
    inside = []
    for seed in range(20):
        fit = solve(Problem(robot, (run(robot, 1.1, seed),), horizon=2.0))
        low, high = fit.interval("gain")
        inside.append(low < 1.1 < high)
        assert abs(fit["gain"] - 1.1) < 0.03
        assert fit.deviation_after[0] < fit.deviation_before[0]
    assert sum(inside) >= 16


def test_windows_count_together(robot: Compiled, run: Any) -> None:
    windows = tuple(run(robot, 1.1, seed) for seed in range(4))
    one, four = (solve(Problem(robot, w, horizon=1.0)) for w in (windows[:1], windows))
    assert four.residuals[0].rows == 4 * one.residuals[0].rows
    assert four.sigma[0] < 0.7 * one.sigma[0]


def test_bounds_hold_are_reported_and_may_be_started_on(robot: Compiled, run: Any) -> None:
    tight = Parameters((Parameter("gain", 1.05, "1", 0.2, 1.05),))
    fit = solve(Problem(robot, (run(robot, 1.4, 0),), prior=tight, horizon=1.0))
    assert fit["gain"] == pytest.approx(1.05)
    assert fit.at_bound == ("gain",)
    assert "widen" in fit.message


def test_divergence_is_a_value_with_a_cure() -> None:
    def step(x: Any, u: Any, dt: float, p: Any) -> Any:
        y = p[0] * x[0] + u[0]
        return [y], [y if abs(y) < 1e6 else np.nan]

    wild = FunctionModel(
        step, Layout.of(u="1"), Layout.of(x="1"), Layout.of(x="1"), Parameters.of(a=(5.0, "1"))
    )
    block = make_block(t=np.arange(30), u=np.ones((30, 1)), y=np.ones((30, 1)))
    fit = solve(Problem(wild, (block,)))
    assert not fit.converged
    assert fit.values.tolist() == [5.0]
    assert fit.verdict == ("not",)
    assert "start from other values" in fit.message
    assert np.isinf(fit.interval95).all()


def test_too_few_evaluations_are_said(robot: Any, wavy: Any, run: Any) -> None:
    problem = Problem(wavy, (run(robot, 0.3, 0),))
    fit = solve(problem, settings=Settings(evaluations=1))
    assert not fit.converged
    assert "allow more" in fit.message


def test_more_starts_leave_a_local_minimum(robot: Any, wavy: Any, run: Any) -> None:
    block = run(robot, np.sin(5 * 1.6), 3)
    near, far = (
        solve(Problem(wavy, (block,), horizon=2.0), settings=Settings(starts=n)) for n in (1, 12)
    )
    assert far.cost <= near.cost * (1 + 1e-12)
    assert np.sin(5 * far["gain"]) == pytest.approx(np.sin(8.0), abs=0.05)
    again = solve(Problem(wavy, (block,), horizon=2.0), settings=Settings(starts=12))
    assert np.array_equal(far.values, again.values)


def test_a_robust_loss_shrugs_off_outliers(axes: Any, measured: Any) -> None:
    rng = np.random.default_rng(5)
    model, u = axes(1), rng.normal(size=(300, 1))
    noise = 0.1 * rng.normal(size=u.shape)
    noise[::11] += 5.0
    block = measured(model, u, P, noise)
    plain, robust = (solve(Problem(model, (block,), loss=loss)) for loss in ("linear", "cauchy"))
    # The width of the error bar follows the core of the residual, not its outliers.
    assert np.abs(robust.values - P[:2]).max() < 0.05
    assert robust.sigma[0] < plain.sigma[0] / 3


def test_cancelling_keeps_the_best_so_far(robot: Compiled, run: Any) -> None:
    seen: list[float] = []

    def watch(evaluations: int, cost: float) -> bool:
        seen.append(cost)
        return len(seen) < 3

    problem = Problem(robot, (run(robot, 1.5, 0),), horizon=1.0)
    fit = solve(problem, settings=Settings(progress=watch))
    assert not fit.converged
    assert "stopped by the caller" in fit.message
    assert abs(fit["gain"] - 1.5) < abs(1.0 - 1.5)


def test_an_unconnected_knob_is_an_error(robot: Compiled, run: Any) -> None:
    loose = replace(robot, parameters=robot.parameters + Parameters.of(unused=(1.0, "1")))
    with pytest.raises(ModelError, match="unused: the knob is not connected"):
        solve(Problem(loose, (run(robot, 1.1, 0),)))


@pytest.mark.parametrize("seed", range(3))
def test_a_knob_that_only_an_overflow_asks_for_is_connected(seed: int) -> None:
    def step(x: Any, u: Any, dt: float, p: Any) -> Any:  # a tank that nothing measures, and below
        upper = x[1] + dt * (0.04 * u[0] - 0.05 * max(x[1], 0.0) ** 0.5)
        over, upper = max(upper - 10.0, 0.0), min(upper, 10.0)
        upper = max(upper, 0.0)
        lower = x[0] + dt * 0.05 * (upper**0.5 - max(x[0], 0.0) ** 0.5) + p[0] * over
        return [lower, upper], [lower]

    tanks = FunctionModel(
        step, Layout.of(u="V"), Layout.of(y="V"), Layout.of(y="V", a="V"),
        Parameters.of(spilt=(0.3, "1")),
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(1.5, 6.3, 40), 35)[:, None]
    with pytest.raises(ModelError):
        connected(tanks, ("spilt",), u)
    connected(tanks, ("spilt",), u, np.full(len(u), 4.0))


@first_of("seed", range(3))
def test_beside_what_is_nearly_unstable_it_is_said_where_it_runs_away(seed: int) -> None:
    def step(x: Any, u: Any, dt: float, p: Any) -> Any:  # Euler: stable from tau = dt/10 on
        y, v = x
        for _ in range(5):
            v = v + dt / 5 * (p[0] * u[0] - v) / p[1]
            y = y + dt / 5 * v
        return [y, v], [y]

    def cylinder(gain: float, tau: float) -> FunctionModel:
        return FunctionModel(
            step, Layout.of(u="V"), Layout.of(y="m"), Layout.of(y="m", v="m/s"),
            Parameters.of(K=(gain, "m/(s V)"), tau=(tau, "s")),
        )  # fmt: skip

    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1, 1, 60), 20)[:, None]
    t = np.arange(len(u)) * 10**7
    true = cylinder(0.04, 0.00111)
    y = true.simulate(np.zeros(2), u, np.full(len(u), 0.01), true.parameters.values)[1]
    rows = make_block(t=t, u=0.1 * u, y=0.1 * y + rng.normal(0, 5e-4, y.shape))
    problem = Problem(cylinder(0.04, 0.00111), (rows,), horizon=1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        acting = problem.sensitivity(problem.start)
        bent, edge = bends(problem, problem.start, acting, np.array([0.05]))
        fit = solve(problem)
    assert np.isfinite(bent).all()
    assert "with tau = 0.0007" in edge and "runs away (y, row " in edge
    assert "nan" not in str(fit) and "inf" not in str(fit)


def test_a_silent_input_is_not_an_unconnected_knob(robot: Compiled) -> None:
    still = make_block(t=np.arange(20) * 10**8, u=np.zeros((20, 1)), y=np.zeros((20, 1)))
    fit = solve(Problem(robot, (still,)))
    assert fit.verdict == ("not",)
    assert fit.values.tolist() == [1.0]
    assert "not excited" in fit.reasons[0]
    assert "a changing command" in fit.reasons[0]


def test_misuse_is_an_exception(robot: Compiled, run: Any) -> None:
    block = run(robot, 1.0, 0)
    with pytest.raises(UsageError, match="at least one window"):
        Problem(robot, ())
    with pytest.raises(UsageError, match="did you mean 'gain'"):
        Problem(robot, (block,), ("gian",))
    with pytest.raises(UsageError, match="expected 1 numbers"):
        Problem(robot, (block,), scale=np.ones(2))
    with pytest.raises(UsageError, match="at least 1 evaluation"):
        Settings(evaluations=0)
    fixed = replace(robot, parameters=Parameters((Parameter("gain", 1.0, "1", editable=False),)))
    with pytest.raises(UsageError, match="no parameter is editable"):
        Problem(fixed, (block,))
    with pytest.raises(UsageError, match="model's parameters"):
        solve(Problem(robot, (block,), prior=Parameters.of(other=(1.0, "1"))))


def test_angles_wrap(robot: Compiled) -> None:
    heading = Layout((Channel("heading", "rad", kind="angle"),))
    turner = replace(robot, outputs=heading, states=heading)
    y = 0.1 * np.arange(200)[:, None]
    wrapped = np.pi - np.mod(np.pi - y, 2 * np.pi)
    block = make_block(t=np.arange(200) * 10**8, u=np.ones((200, 1)), y=wrapped)
    fit = solve(Problem(turner, (block,), horizon=1.0))
    assert fit["gain"] == pytest.approx(1.0)


def test_variable_projection_keeps_linear_bounds(axes: Any, measured: Any) -> None:
    rng = np.random.default_rng(6)
    model, u = axes(1), rng.normal(size=(200, 1))
    block = measured(model, u, np.array([3.0, 2.0, 0.3]), 0.1 * rng.normal(size=u.shape))
    items = [replace(i, low=0.0, high=2.5) if i.name == "Fc0" else i for i in model.parameters]
    prior = Parameters(tuple(replace(i, value=0.2) if i.name == "width" else i for i in items))
    fit = solve(Problem(model, (block,), ("Fc0", "Bm0", "width"), prior=prior))
    assert fit["Fc0"] == pytest.approx(2.5)
    assert fit["Bm0"] == pytest.approx(2.0, abs=0.6)


def test_nothing_excited_is_nothing_to_solve(wavy: Any) -> None:
    still = make_block(t=np.arange(20) * 10**8, u=np.zeros((20, 1)), y=np.zeros((20, 1)))
    fit = solve(Problem(wavy, (still,)), settings=Settings(starts=3))
    assert fit.converged
    assert "nothing to solve" in fit.message


def leaking() -> FunctionModel:
    """A tank in plain Python, built the same in every process."""
    level = Layout.of(h="m")
    items = Parameters((Parameter("leak", 0.5, "1/s", 0.0, 5.0), Parameter("gain", 1.0, "1")))
    return FunctionModel(_leak, Layout.of(q="m/s"), level, level, items)


def _leak(x: Any, u: Any, dt: float, p: Any) -> Any:
    level = x[0] + dt * (p[1] * u[0] - p[0] * x[0])
    return [level], [level]


def filled(seed: int = 0, rows: int = 200) -> Any:
    rng, model = np.random.default_rng(seed), leaking()
    u = np.repeat(rng.uniform(0, 1, (rows // 20, 1)), 20, axis=0)
    _, h = model.simulate(np.zeros(1), u, np.full(rows, 0.1), np.array([0.8, 1.3]))
    y = np.concatenate([[[0.0]], h[:-1]]) + rng.normal(0, 0.01, (rows, 1))
    return make_block(t=np.arange(rows) * 10**8, u=u, y=y)


def test_differences_in_other_processes_give_the_same_fit() -> None:
    problem = Problem(leaking(), (filled(),))
    here = solve(problem)
    with Pool(1) as pool:
        there = solve(problem, settings=Settings(far=Far(pool.map, leaking, "leaking")))
    assert np.array_equal(here.values, there.values)
    assert np.array_equal(here.covariance, there.covariance)
    assert here["leak"] == pytest.approx(0.8, abs=0.05)


def test_all_columns_are_simulated_at_once(robot: Compiled, run: Any) -> None:
    sizes: list[int] = []

    @dataclass(frozen=True)
    class Counting(Compiled):
        def simulate_batch(self, x: Any, u: Any, dt: Any, p: Any, restart: Any = None) -> Any:
            sizes.append(len(p))
            return Batch(robot).run(u, dt, p, restart)

    fields = {name: getattr(robot, name) for name in robot.__dataclass_fields__}
    fit = solve(Problem(Counting(**fields), (run(robot, 1.2, 1),), horizon=1.0))
    assert fit["gain"] == solve(Problem(robot, (run(robot, 1.2, 1),), horizon=1.0))["gain"]
    # a residual; a column beside its centre, or the two ends of one; both, by the noise of starts
    assert set(sizes) == {1, 2, 3}


def test_the_problem_may_say_how_hard_to_search(robot: Compiled, run: Any) -> None:
    problem = Problem(robot, (run(robot, 1.5, 0),), horizon=1.0, settings=Settings(evaluations=1))
    assert "allow more" in solve(problem).message
    assert solve(problem, settings=Settings()).converged


def test_ctrl_c_keeps_the_best_so_far(robot: Compiled, run: Any) -> None:
    def watch(evaluations: int, cost: float) -> bool:
        if evaluations > 3:
            signal.raise_signal(signal.SIGINT)
        return True

    # a shell's background jobs ignore Ctrl-C, and so would this test there
    before = signal.default_int_handler
    signal.signal(signal.SIGINT, before)
    problem = Problem(robot, (run(robot, 1.5, 0),), horizon=1.0)
    fit = solve(problem, settings=Settings(progress=watch, interrupt=True))
    assert not fit.converged
    assert "stopped" in fit.message
    assert abs(fit["gain"] - 1.5) < abs(1.0 - 1.5)
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(KeyboardInterrupt):
        solve(problem, settings=Settings(progress=watch))


def test_a_stop_while_the_noise_is_estimated_anew_keeps_the_search_before(
    robot: Compiled, run: Any
) -> None:
    block = run(robot, 1.5, 0)
    whole = solve(Problem(robot, (block,), horizon=1.0, loss="soft_l1"))
    for last in range(3, whole.evaluations, 4):

        def watch(evaluations: int, cost: float, last: int = last) -> bool:
            return evaluations < last

        fit = solve(
            Problem(robot, (block,), horizon=1.0, loss="soft_l1"), settings=Settings(progress=watch)
        )
        assert abs(fit["gain"] - 1.5) <= 0.5
    assert fit["gain"] == pytest.approx(whole["gain"], abs=1e-3)
