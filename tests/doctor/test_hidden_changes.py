"""The doctor says which changes of a machine stay within what is asked of its twin."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec, TwinSpec
from evertwin.doctor.finding import Finding
from evertwin.models import Parameters
from evertwin.models.functions.translated import Translated
from evertwin.signals import Layout
from evertwin.twin import Twin
from planted.draws import first_of

LEVEL = Layout.of(temperature="degC")


def step(x: Any, u: Any, dt: float, p: Any) -> Any:
    level = x[0] + dt * (p[0] * u[0] - x[0] + u[1]) / p[1]
    return [level], [level]


def hidden(seed: int, horizon: float, requirement: float) -> tuple[Finding, ...]:
    """What is said of an oven that takes `T` to warm up, its numbers right."""
    rng = np.random.default_rng(seed)
    gain, T, n = rng.uniform(20.0, 60.0), rng.uniform(600.0, 1500.0), 4000
    heating, room = np.repeat(rng.integers(0, 2, n // 100).astype(float), 100), np.full(n, 20.0)
    y = np.full(n, 20.0)
    for i in range(1, n):
        y[i] = y[i - 1] + 5.0 * (gain * heating[i] + room[i] - y[i - 1]) / T
    model = Translated(
        step, Layout.of(heating="1", room="degC"), LEVEL, LEVEL,
        Parameters.of(gain=(gain, "K"), T=(T, "s")),
    )  # fmt: skip
    spec = TwinSpec(
        "oven", ModelSpec("python"), prediction=PredictionSpec(horizon=horizon),
        anomaly=AnomalySpec(requirement=requirement, relative=False),
    )  # fmt: skip
    rows = {"heating": heating, "room": room, "temperature": y + rng.normal(0.0, 0.05, n)}
    with Twin(spec, model) as twin:
        return twin.doctor({"t": 5.0 * np.arange(n), **rows}).of_kind("hidden")


@first_of("seed", range(3))
def test_a_short_horizon_hides_what_a_longer_one_shows(seed: int) -> None:
    (said,) = hidden(seed, 20.0, 1.5)
    assert {"gain", "T"} == set(said.evidence["of_requirement"])
    assert said.evidence["horizon"] in (60.0, 200.0, 600.0)
    assert not hidden(seed, said.evidence["horizon"], 0.3)


def test_what_is_asked_finely_hides_nothing() -> None:
    assert not hidden(0, 200.0, 0.1)
