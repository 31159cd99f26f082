"""A number that makes up for what the model's integration errs by has an interval that says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters, Twin, TwinSpec
from evertwin.config import spec

STATES = Layout.of(x="m", v="m/s")


def implicit(x: Any, u: Any, dt: float, p: Any) -> Any:
    """Stops within 2 ms, taken in parts of 2.5 ms."""
    place, speed = x
    for _ in range(4):
        speed = (speed + dt / 4 * u[0] / p[0]) / (1.0 + dt / 4 * p[1] / p[0])
        place += dt / 4 * speed
    return [place, speed], [place, speed]


def by_row(x: Any, u: Any, dt: float, p: Any) -> Any:
    """A recursion of rows: it knows no time."""
    place = p[0] * x[0] + p[1] * u[0]
    return [place, place], [place, place]


def fitted(step: Any, true: dict[str, float], fine: int, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    numbers = Parameters.of(**{name: (1.5 * value, "1") for name, value in true.items()})
    model = FunctionModel(step, Layout.of(force="N"), STATES, STATES, numbers)
    u, y = np.repeat(rng.uniform(-10.0, 10.0, 25), 20), np.empty((500, 2))
    x: Any = [0.0, 0.0]
    for k in range(500):
        y[k] = x
        for _ in range(fine):
            x = step(x, [u[k]], 0.01 / fine, list(true.values()))[0]
    y += 0.003 * y.std(axis=0) * rng.normal(size=y.shape)
    horizon = spec.PredictionSpec(horizon=0.5)
    twin = Twin(TwinSpec("axis", spec.ModelSpec("python"), prediction=horizon), model)
    return twin.fit({"t": 0.01 * np.arange(500), "force": u, "x": y[:, 0], "v": y[:, 1]}).fit


@pytest.mark.parametrize("seed", range(4))
def test_a_stiff_mass_has_an_interval_that_holds(seed: int) -> None:
    fit = fitted(implicit, {"mass": 0.1, "c": 50.0}, 10, seed)
    low, high = fit.interval("mass")
    assert fit["mass"] < 0.08, str(fit)  # for it makes up for the long steps
    assert low <= 0.1 <= high, str(fit)
    assert "hangs on the step of the model" in fit.reasons[0]
    assert fit.interval("c")[0] < 50.0 < fit.interval("c")[1] and fit.verdict[1] == "identifiable"


def test_short_steps_widen_little() -> None:
    fit = fitted(implicit, {"mass": 10.0, "c": 50.0}, 1, 0)
    assert fit.verdict == ("identifiable", "identifiable")
    low, high = fit.interval("mass")
    assert high - low < 0.2 and low < 10.0 < high, str(fit)


def test_a_model_of_rows_is_none_in_time() -> None:
    fit = fitted(by_row, {"stays": 0.9, "moves": 0.1}, 1, 0)
    assert fit.verdict == ("identifiable", "identifiable")
    assert not any("step of the model" in reason for reason in fit.reasons), str(fit)
    low, high = fit.interval95[0]
    assert high - low < 0.02 and low < 0.9 < high
