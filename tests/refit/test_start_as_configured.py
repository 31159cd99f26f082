"""A fit that begins anew elsewhere still says what was configured, and puts back to it."""

from __future__ import annotations

from dataclasses import replace
from math import sin
from typing import Any

import numpy as np

from evertwin.fold import make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import translated
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve
from evertwin.tuning.search.minima import lowest
from planted.draws import first_of

TRUE, START = np.array([20.0, 0.3, 10.0]), (8.0, 0.9, 4.0)


def pendulum(x: Any, u: Any, dt: float, p: Any) -> Any:
    angle, speed = x
    for _ in range(4):
        speed += dt / 4 * (p[2] * u[0] - p[0] * sin(angle) - p[1] * speed)
        angle += dt / 4 * speed
    return [angle, speed], [angle]


def problem_of(seed: int) -> Problem:
    """A pendulum that goes over the top, its speed not measured."""
    rng, n, dt = np.random.default_rng(seed), 400, 0.02
    names = {name: (value, "1") for name, value in zip("gdk", START, strict=True)}
    angle, states = Layout.of(angle="rad"), Layout.of(angle="rad", speed="rad/s")
    model = FunctionModel(pendulum, Layout.of(torque="Nm"), angle, states, Parameters.of(**names))
    model = translated(model)
    torque = np.repeat(rng.normal(0, 1.6, n // 25), 25)[:, None]
    _, y = model.simulate(np.zeros(2), torque, np.full(n, dt), TRUE)
    seen = y + rng.normal(0, 0.01, y.shape)
    rows = make_block(t=np.arange(n) * 20_000_000, u=torque, y=np.vstack([[[0.0]], seen[:-1]]))
    return Problem(model, (rows._replace(u=np.vstack([torque[:1], torque[:-1]])),), tuple("gdk"))


@first_of("seed", range(6))
def test_the_start_is_the_configured_one(seed: int) -> None:
    problem = problem_of(seed)
    begun = lowest(problem)
    fit = solve(begun)
    assert begun is not problem and begun.settings.begin  # the first search went astray
    assert np.abs(fit.values / TRUE - 1.0).max() < 0.01
    assert fit.start.tolist() == list(START)
    assert fit.deviation_before == solve(problem).deviation_before > (0.5,)


def test_what_is_not_told_goes_back_to_what_was_configured() -> None:
    problem = problem_of(0)
    parameters = problem.model.parameters + Parameters.of(idle=(7.0, "1"))

    def step(x: Any, u: Any, dt: float, p: Any) -> Any:
        return pendulum(x, u, dt, p[:3])

    layouts = problem.model.inputs, problem.model.outputs, problem.model.states
    model = FunctionModel(step, *layouts, parameters)
    begun = lowest(Problem(translated(model), problem.windows, (*"gdk",)))
    lenient = replace(begun, settings=replace(begun.settings, lenient=True))
    fit = solve(lenient.tuning((*"gdk", "idle")))
    assert fit.values[3] == 7.0 and fit.verdict[3] == "not"
    assert fit.start.tolist() == [*START, 7.0]
