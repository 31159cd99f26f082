"""A machine that changes as a version goes live, which then is not to blame for it."""

from __future__ import annotations

import numpy as np

from evertwin import FunctionModel, Layout, Parameter, Parameters, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.sync.spec import SignalSpec
from evertwin.tuning.spec import TuningSpec
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of

ROWS, AT, STEP, MASS = 6000, 3000, 20.0, 2e5


def water(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    """Warmed through a valve, cooled by the room."""
    warm = x[0] + dt * (p[1] * u[0] * (u[1] - x[0]) - p[0] * (x[0] - 18.0)) / MASS
    return [warm], [warm]


def heated(seed: int, start: tuple[float, float]) -> RunResult:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(15, 60, ROWS)
    valve = np.repeat(rng.uniform(0.15, 0.85, ROWS), lengths)[:ROWS]
    flow = 65.0 + 4.0 * np.sin(np.arange(ROWS) / 60.0)
    warm, x = np.zeros(ROWS), 25.0
    for k in range(ROWS):
        if k:
            loss = 144.0 if k >= AT else 120.0
            (x,), _ = water(np.array([x]), np.array([valve[k], flow[k]]), STEP, [loss, 200.0])
        warm[k] = x
    data = {
        "t": np.arange(ROWS) * STEP, "valve": valve, "flow": flow,
        "warm": warm + rng.normal(0.0, 0.05, ROWS),
    }  # fmt: skip
    model = FunctionModel(
        water,
        Layout.of(valve="1", flow="K"),
        Layout.of(warm="K"),
        Layout.of(warm="K"),
        Parameters(
            (
                Parameter("loss", start[0], "W/K", 6.0, 2400.0),
                Parameter("gain", start[1], "W/K", 10.0, 4000.0),
            )
        ),
    )
    spec = TwinSpec(
        "heating", ModelSpec("python"), prediction=PredictionSpec(1800.0),
        signals={"flow": SignalSpec(hold=False)},
        anomaly=AnomalySpec(requirement=0.5, relative=False, window=Span(rows=1000)),
        tuning=TuningSpec(window=Span(rows=3000)),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        return twin.run(data)


@first_of("seed", range(3))
def test_a_version_is_not_rolled_back_for_what_the_machine_changed(seed: int) -> None:
    result = heated(seed, (200.0, 300.0))
    assert not result.of_kind("rolled_back")
    changed = result.of_kind("changed")
    assert changed and abs(changed[0].evidence["row"] - AT) < 100
    assert abs(result.parameters["loss"].value - 144.0) < 6.0


def two_gains(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[Vector, list[float]]:
    return x, [p[0] * u[0], p[1] * u[0]]


@first_of("seed", range(3))
def test_a_second_change_soon_after_a_promotion_is_asked_about_before_its_window_ends(
    seed: int,
) -> None:
    """The version that went live was never judged on a whole window; the one before it was."""
    rng, n, window = np.random.default_rng(seed), 6000, 1500
    u = np.sin(np.arange(n) * 0.07 + rng.uniform(0, 6)) + np.sin(np.arange(n) * 0.031)
    first = np.where(np.arange(n) < AT, 1.0, 1.3)
    second = np.where(np.arange(n) < AT + 1200, 1.0, 1.3)
    noise = 0.01 * rng.normal(size=(2, n))
    data = {"t": np.arange(n) * 0.01, "u": u, "y": first * u + noise[0], "z": second * u + noise[1]}
    model = FunctionModel(
        two_gains, Layout.of(u="1"), Layout.of(y="1", z="1"),
        parameters=Parameters.of(first=(1.0, "1"), second=(1.0, "1")),
    )  # fmt: skip
    spec = TwinSpec(
        "two", ModelSpec("python"), prediction=PredictionSpec(0.1),
        anomaly=AnomalySpec(requirement=0.05, relative=True, window=Span(rows=window)),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        result = twin.run(data)
    lives = [e.row for e in result.of_kind("promoted")]
    assert AT < lives[0] < AT + 1200, "the first change is live when the second one comes"
    asked = next(e.row for e in result.of_kind("tuned") if e.row > AT + 1200)
    assert asked < AT + 1200 + window // 2
    assert abs(result.parameters["second"].value - 1.3) < 0.02
