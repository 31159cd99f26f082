"""Of a model that is not compiled the doctor bounds the calls, says so, and finds what is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import ModelSpec, PredictionSpec, TwinSpec
from evertwin.doctor import examination
from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.models.functions.translated import translated
from evertwin.signals import Layout
from evertwin.twin import Twin

ROWS = 6000


def test_calls_are_bounded_and_a_wrong_sign_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examination, "FEW", 300)
    monkeypatch.setattr(examination, "FOLLOWED", 1000)
    calls = 0

    def step(x: np.ndarray, u: np.ndarray, dt: float, p: np.ndarray) -> tuple[list[float], ...]:
        nonlocal calls
        calls += 1
        y = x[0] + (p[0] * u[0] - x[0]) * dt / p[1]
        return [y], [y]

    level = Layout.of(y="1")
    numbers = (Parameter("gain", 1.0, "1"), Parameter("T", 2.0, "s", low=0.1, high=100.0))
    model = FunctionModel(step, Layout.of(u="1"), level, level, Parameters(numbers))
    rng = np.random.default_rng(3)
    u, y = np.repeat(rng.normal(size=ROWS // 20), 20), np.zeros(ROWS)
    for i in range(1, ROWS):
        y[i] = y[i - 1] + (u[i - 1] - y[i - 1]) * 0.05
    spec = TwinSpec("own", ModelSpec("python"), prediction=PredictionSpec(horizon=1.0))
    data = {"t": 0.1 * np.arange(ROWS), "u": -u, "y": y + rng.normal(0, 0.01, ROWS)}
    with Twin(spec, model) as twin:
        calls = 0
        found = twin.doctor(data)
    assert found.of_kind("sign") and found.rows == ROWS
    assert calls < 40 * ROWS  # hundreds of passes over all rows without a bound
    assert "from the first 300 rows, faults of sensors from the first 1000" in found.text()


def test_a_step_that_runs_as_machine_code_is_not_slow() -> None:
    level = Layout.of(y="1")
    model, plain = (
        FunctionModel(
            one, Layout.of(u="1"), level, level, Parameters.of(gain=(1.0, "1"), T=(2.0, "s"))
        )
        for one in (_lag, _plain_lag)
    )
    assert translated(model) is not model and translated(plain) is plain
    rng = np.random.default_rng(5)
    u = np.repeat(rng.normal(size=100), 20)
    data = {"t": 0.1 * np.arange(2000), "u": u, "y": u}
    spec = TwinSpec("own", ModelSpec("python"), prediction=PredictionSpec(horizon=1.0))
    for one, slow in ((plain, True), (model, False)):
        with Twin(spec, one) as twin:
            assert ("is not compiled" in twin.doctor(data).text()) == slow


def _lag(x: Any, u: Any, dt: float, p: Any) -> Any:
    y = x[0] + (p[0] * u[0] - x[0]) * dt / p[1]
    return [y], [y]


def _plain_lag(x: Any, u: Any, dt: float, p: Any, share: float = 1.0) -> Any:
    return _lag(x, share * u, dt, p)
