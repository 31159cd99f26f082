"""A channel whose record goes on as it was is in no other unit: the machine changed by as much."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.models import Parameters
from evertwin.models.functions.translated import translated
from planted.draws import first_of

AT, ROWS = 1500, 3000


def step(x: Any, u: Any, dt: float, p: Any) -> tuple[Any, Any]:
    """What flows through is warmed, the less the faster it flows."""
    effect = 1.0 - math.exp(-p[0] / max(u[0], 1e-6))
    warm = x[0] + dt * (effect * u[1] - x[0]) / p[1]
    return [warm], [warm]


def exchanger(seed: int, *, transfer: float, recorded: float) -> RunResult:
    """From AT on its transfer is ``transfer`` times what it was, and its flow ``recorded`` so."""
    rng, x = np.random.default_rng(seed), [10.0]
    flow = np.repeat(rng.uniform(0.8, 1.2, ROWS // 20), 20)
    gap = np.repeat(rng.uniform(30.0, 60.0, ROWS // 50), 50)
    since, y = np.arange(ROWS) >= AT, np.empty(ROWS)
    for k in range(ROWS):
        p = (1.5 * (transfer if since[k] else 1.0), 30.0)
        x, _ = step(x, (flow[k], gap[k]), 5.0, p)
        y[k] = x[0]
    warm = Layout.of(warm="1")
    numbers = Parameters.of(transfer=(1.5, "kg/s"), lag=(30.0, "s"))
    model = translated(FunctionModel(step, Layout.of(flow="kg/s", gap="1"), warm, warm, numbers))
    spec = TwinSpec(
        "exchanger", ModelSpec("given"), prediction=PredictionSpec(horizon=50.0), beat=Span(20),
        anomaly=AnomalySpec(requirement=1.5, relative=False, window=Span(200)),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        later = {"flow": np.where(since, recorded, 1.0) * flow, "gap": gap}
        rows = {name: np.append(value[1:], value[-1]) for name, value in later.items()}
        return twin.run({"t": 5.0 * np.arange(ROWS), **rows, "warm": y + rng.normal(0, 0.1, ROWS)})


@first_of("seed", range(3))
def test_transfer_that_is_lost_is_no_decimal_prefix(seed: int) -> None:
    result = exchanger(seed, transfer=0.1, recorded=1.0)
    assert not [e for e in result.of_kind("abnormal") if "number" in e.evidence], result.headline
    assert result.parameters["transfer"].value == pytest.approx(0.15, rel=0.05)


@pytest.mark.parametrize("seed", (0, 2))
def test_a_flow_in_tenths_is_named(seed: int) -> None:
    result = exchanger(seed, transfer=1.0, recorded=10.0)
    assert "flow has been in error since row 1500" in result.headline
    assert "is off by a factor of 10 from what it was" in result.headline
    assert not result.of_kind("promoted")


@first_of("seed", range(4))
def test_a_command_whose_level_rose_by_a_units_number_is_named(seed: int) -> None:
    """A cart drives as before, its command in km/h from a standstill on: no jump tells of it."""
    rng, row = np.random.default_rng(seed), np.arange(ROWS)
    v = np.interp(row, np.arange(0, ROWS + 60, 60), rng.uniform(0, 0.9, ROWS // 60 + 1))
    v *= np.minimum(np.abs(row - AT) / 40, 1.0)
    x = np.cumsum(0.1 * np.append(0.0, v[:-1])) + rng.normal(0, 0.002, ROWS)
    spec = TwinSpec(
        "cart", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0), beat=Span(20),
        anomaly=AnomalySpec(requirement=0.02, relative=False, window=Span(200)),
    )  # fmt: skip
    with Twin(spec) as twin:
        result = twin.run({"t": 0.1 * row, "v": np.where(row >= AT, 3.6, 1.0) * v, "x": x})
    assert "v looks 3.6 times what it is" in result.headline
    assert not result.of_kind("promoted")
