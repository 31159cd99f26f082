"""A heat exchanger that fouls slowly beside inputs whose sensors may drift, and do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.gauges.shifts.course import evidence
from evertwin.models.functions.translated import translated
from evertwin.sync.spec import SignalSpec
from evertwin.tuning.spec import TuningSpec
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of

ROWS, AT, GROWS, DT = 6400, 2700, 2700, 5.0
MEASURED = ("hot_flow", "cold_flow", "hot_in", "cold_in")


def heated(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    hot, cold = max(u[0], 1e-4) * 4180.0, max(u[1], 1e-4) * 4180.0
    least, ratio = min(hot, cold), min(hot, cold) / max(hot, cold)
    units = p[0] * (max(u[0], 1e-4) / 0.16) ** 0.4 / least
    q = math.exp(-units * (1.0 - ratio))
    share = units / (1.0 + units) if 1.0 - ratio < 1e-6 else (1.0 - q) / (1.0 - ratio * q)
    goal = u[3] + share * least * (u[2] - u[3]) / cold
    out = goal + (x[0] - goal) * math.exp(-dt / p[1])
    return [out], [out]


def exchanger(seed: int, fouls: float = 0.0, drifts: float = 0.0) -> RunResult:
    """Its transfer falls by a share, or the hot inlet's sensor drifts by some kelvin."""
    rng, inputs = np.random.default_rng(seed), []
    for low, high in ((0.08, 0.25), (0.15, 0.4), (333.0, 353.0)):
        column, k = np.empty(ROWS), 0
        while k < ROWS:
            column[k : (k := k + int(rng.integers(60, 160)))] = rng.uniform(low, high)
        for k in range(1, ROWS):
            column[k] = column[k - 1] + 0.2 * (column[k] - column[k - 1])
        inputs.append(column)
    u = np.column_stack([*inputs, np.full(ROWS, 288.0)])
    grown, out, y = np.clip((np.arange(ROWS) - AT) / GROWS, 0.0, 1.0), 300.0, np.empty(ROWS)
    for k in range(ROWS):
        y[k] = out
        out = heated([out], u[k], DT, [900.0 * (1.0 - fouls * grown[k]), 60.0])[0][0]  # type: ignore[arg-type]
    u = u + rng.normal(0.0, 1.0, u.shape) * [8e-4, 1e-3, 0.05, 0.05]
    u[:, 2] += drifts * grown
    data = dict(zip(MEASURED, u.T, strict=True))
    data |= {"t": DT * np.arange(ROWS), "cold_out": y + rng.normal(0.0, 0.08, ROWS)}
    model = translated(FunctionModel(
        heated, Layout.of(hot_flow="kg/s", cold_flow="kg/s", hot_in="K", cold_in="K"),
        Layout.of(cold_out="K"), Layout.of(cold_out="K"),
        Parameters.of(transfer=(900.0, "W/K"), lag=(60.0, "s")),
    ))  # fmt: skip
    spec = TwinSpec(
        "exchanger", ModelSpec("python"), beat=Span(seconds=300.0),
        signals={name: SignalSpec(hold=False) for name in MEASURED},
        prediction=PredictionSpec(300.0),
        anomaly=AnomalySpec(requirement=1.0, relative=False, window=Span(seconds=1800.0)),
        tuning=TuningSpec(window=Span(seconds=7200.0), causes={"fouling": ("transfer",)}),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        return twin.run(data)


def _of_sensors(result: RunResult) -> list[str]:
    return [e.reason for e in result.of_kind("abnormal") if "number" in e.evidence]


@first_of("seed", range(3))
def test_slow_fouling_is_named_and_tuned(seed: int) -> None:
    result = exchanger(seed, fouls=0.4)
    assert not [said for said in _of_sensors(result) if "cannot be told" not in said]
    assert result.of_kind("normal")[0].signal == "fouling"
    assert result.of_kind("promoted")


@first_of("seed", range(3))
def test_a_sensor_that_drifts_is_not_learned(seed: int) -> None:
    result = exchanger(seed, drifts=8.0)
    assert "hot_in looks off by what has grown to" in _of_sensors(result)[0]
    assert not result.of_kind("promoted")


@pytest.mark.parametrize("phase", np.linspace(0.0, 6.0, 12).tolist())
def test_a_record_that_strays_slowly_by_itself_accuses_nobody(phase: float) -> None:
    k = np.arange(1440)
    record = 2.0 * np.sin(k / 360.0 + phase) + np.random.default_rng(3).normal(0.0, 0.05, 1440)
    assert evidence(record, -2.4, (240, 1439)) == 0.0
