"""What is not called identifiable: rows that tell nothing of the noise, a bound, a form astray."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters
from evertwin.fold import make_block
from evertwin.models import Parameter
from evertwin.models.functions.translated import translated
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.intervals.followed import missed


def line(rows: int, top: float = np.inf, noise: float = 0.0) -> Fit:
    """A straight line of two numbers, 3 and −2."""
    slope, level = Parameter("slope", 1.0, "1", -np.inf, top), Parameter("level", 1.0, "1")
    model = FunctionModel(
        lambda x, u, dt, p: ([], [p[0] * u[0] + p[1]]), Layout.of(u="1"), Layout.of(y="1"),
        parameters=Parameters((slope, level)),
    )  # fmt: skip
    u = np.arange(1.0, rows + 1.0)[:, None]
    y = 3.0 * u - 2.0 + noise * np.random.default_rng(0).normal(size=u.shape)
    return solve(Problem(model, (make_block(t=np.arange(rows), u=u, y=y),)))


def test_as_many_rows_as_numbers_tell_no_interval() -> None:
    fit = line(2)
    assert fit.verdict == ("weak", "weak") and np.isinf(fit.sigma).all()
    assert fit.values.tolist() == pytest.approx([3.0, -2.0])
    assert all("no more values than numbers" in reason for reason in fit.reasons)
    assert line(20, noise=0.1).verdict == ("identifiable", "identifiable")


def test_a_number_on_its_bound_is_at_most_or_at_least_that() -> None:
    fit = line(20, top=2.5, noise=0.1)
    assert fit["slope"] == 2.5 and fit.verdict[0] == "weak"
    assert "ended on its bound: at least 2.5" in fit.reasons[0]


def stuck(x: Any, u: Any, dt: float, p: Any) -> Any:
    """Moves where the force is larger than the friction."""
    speed = x[1] + dt * max(abs(u[0]) - p[0], 0.0) * np.sign(u[0]) - dt * p[1] * x[1]
    return [x[0] + dt * speed, speed], [x[0] + dt * speed, speed]


STATES = Layout.of(x="m", v="m/s")


def pushed(friction: float) -> Problem:
    """A mass whose friction of 1 is started from ``friction``."""
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(-5.0, 5.0, 40), 10)[:, None]
    numbers = Parameters.of(friction=(friction, "m/s^2"), rubs=(friction, "1/s"))
    model = translated(FunctionModel(stuck, Layout.of(a="m/s^2"), STATES, STATES, numbers))
    _, y = model.simulate(np.zeros(2), u, np.full(400, 0.05), np.array([1.0, 2.0]))
    noisy = y + rng.normal(0.0, 0.01, y.shape)
    rows = make_block(t=50_000_000 * np.arange(1, 401), u=u, y=noisy)
    return Problem(model, (rows,), horizon=1.0)


def test_a_search_that_moved_nothing_tells_no_number() -> None:
    """No force is above the friction that it starts from, so no step says where to go."""
    problem = pushed(20.0)
    fit = solve(problem)
    assert "identifiable" not in fit.verdict, str(fit)
    assert (missed(problem, fit.values) > 0.7).any()


def test_what_the_noise_of_the_starts_leaves_is_followed() -> None:
    problem = pushed(1.2)
    fit = solve(problem)
    assert fit.verdict == ("identifiable", "identifiable"), str(fit)
    assert (missed(problem, fit.values) < 0.03).all()
