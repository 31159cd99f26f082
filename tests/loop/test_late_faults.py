"""A fault that is told some rows late leaves nothing behind, and lasts until it is over."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin
from evertwin.config import spec
from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.models.functions.translated import translated
from evertwin.signals import Layout
from planted.draws import first_of

PERIOD, LAG = 0.02, 0.3
ONSET, OVER, ROWS = 3080, 4580, 6000


def follows(x, u, dt, p):  # type: ignore[no-untyped-def]
    v = u[0] + (x[1] - u[0]) * 2.718281828 ** (-dt / p[0])
    return [x[0] + dt * v, v], [x[0] + dt * v, v]


def shuttle() -> Twin:
    """A carriage that follows its command late; its place and its speed are measured."""
    both = Layout.of(x="m", v="m/s")
    lag = Parameters((Parameter("lag", LAG, "s", low=0.05, high=2.0),))
    model = translated(FunctionModel(follows, Layout.of(command="m/s"), both, both, lag))
    settings = spec.TwinSpec(
        "shuttle", spec.ModelSpec("x"), beat=spec.Span(100),
        prediction=spec.PredictionSpec(horizon=2.0),
        anomaly=spec.AnomalySpec(
            requirement=0.02, relative=False, window=spec.Span(600), outputs=("x",)
        ),
    )  # fmt: skip
    return Twin(settings, model)


def driven(seed: int) -> dict[str, np.ndarray]:
    """Out, home again, and a rest there, where a place is near zero in any unit."""
    rng = np.random.default_rng(seed)
    trips = [np.repeat((1.0, -1.0, 0.0), 100) * rng.uniform(0.8, 2.0) for _ in range(ROWS // 300)]
    command, x, v = np.concatenate(trips), np.zeros(ROWS), np.zeros(ROWS)
    for k in range(1, ROWS):
        v[k] = command[k - 1] + (v[k - 1] - command[k - 1]) * np.exp(-PERIOD / LAG)
        x[k] = x[k - 1] + PERIOD * v[k]
    place, speed = x + rng.normal(0.0, 0.001, ROWS), v + rng.normal(0.0, 0.004, ROWS)
    return {"t": PERIOD * np.arange(ROWS), "command": command, "x": place, "v": speed}


@pytest.mark.parametrize("seed", range(5))
def test_rows_before_a_freeze_was_told_are_no_deviation(seed: int) -> None:
    table = driven(seed)
    table["x"][ONSET:] = table["x"][ONSET]
    result = shuttle().run(table)
    assert [event.evidence["cause"] for event in result.of_kind("measurement_error")] == ["frozen"]
    assert not result.of_kind("suspected", "abnormal", "normal", "tuned")


@pytest.mark.parametrize("digit", [1e-3, 1e-6])
@pytest.mark.parametrize("factor", [1 / 25.4, 0.1, 25.4])
@first_of("seed", range(3))
def test_a_wrong_unit_lasts_whatever_digits_it_leaves(
    seed: int, factor: float, digit: float
) -> None:
    table = driven(seed)
    table["x"][ONSET:OVER] *= factor
    table["x"] = np.round(table["x"] / digit) * digit
    result = shuttle().run(table)
    (error,) = result.of_kind("measurement_error")
    (restored,) = result.of_kind("measurement_restored")
    assert error.evidence["cause"] == "factor" and error.row < ONSET + 50
    assert OVER <= restored.row < OVER + 50
    assert not result.of_kind("suspected", "abnormal", "tuned")
