"""A coil that fouls, whose model has no answer to a valve below zero: that explains nothing."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin import Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.gauges.rows.reading import Reading
from evertwin.models import Parameter, Parameters
from evertwin.models.functions.translated import Translated
from evertwin.signals import Layout

ROWS, DT = 3000, 10.0


def step(x: Any, u: Any, dt: float, p: Any) -> tuple[Any, Any]:
    """Water that gives its heat to air, by a power of the flow."""
    heat = p[0] * (0.05 + 0.45 * u[0]) ** 0.7 * (x[0] - u[2])
    y = x[0] + dt * (4186.0 * (0.05 + 0.45 * u[0]) * (u[1] - x[0]) - heat) / 4e4
    return [y], [y]


COIL = Translated(
    step, Layout.of(valve="1", supply="K", air="K"), Layout.of(water="K"), Layout.of(water="K"),
    parameters=Parameters((Parameter("ua", 2000.0, "W/K", low=100.0, high=9000.0),)),
)  # fmt: skip


def fouled(ua: float) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    valve = np.repeat(rng.uniform(0.1, 0.9, ROWS // 60), 60)
    supply = 328.0 + 3.0 * np.sin(np.arange(ROWS) / 300)
    air = 290.0 + 2.0 * np.sin(np.arange(ROWS) / 700)
    water, x = np.empty(ROWS), np.array([315.0])
    for k in range(ROWS):
        water[k] = x[0]
        x = np.array(step(x, (valve[k], supply[k], air[k]), DT, (ua,))[0])
    return {
        "t": DT * np.arange(ROWS), "valve": valve, "supply": supply, "air": air,
        "water": np.round(water + rng.normal(0.0, 0.05, ROWS), 1),
    }  # fmt: skip


def test_a_coil_that_fouls_is_tuned_and_no_channel_is_accused() -> None:
    spec = TwinSpec(
        "coil", ModelSpec("python"), beat=Span(seconds=200.0), prediction=PredictionSpec(100.0),
        anomaly=AnomalySpec(requirement=0.5, relative=False, window=Span(seconds=5000.0)),
    )  # fmt: skip
    with Twin(spec, COIL) as twin:
        twin.promote(twin.keep(twin.fit(fouled(2000.0))).number)
        result = twin.run(fouled(900.0))
    assert not [e for e in result.of_kind("abnormal") if "number" in e.evidence]
    assert result.of_kind("promoted") and abs(result.parameters["ua"].value / 900.0 - 1.0) < 0.05


def test_what_is_missing_of_another_channel_is_missing_of_that_alone() -> None:
    mixed = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 2.0], [0.0, 1.0, 0.0]])
    one = Reading((0, 1, 2), np.ones(3), np.zeros(3), ("b", "c"), 1.0, "exchanged", mixed)
    assert one.of(np.array([[np.nan, 3.0, 5.0]]))[0, 1:].tolist() == [7.0, 3.0]
