"""What an untuned model with states gets wrong is no fault of a sensor, and no lag."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import ArbiterSpec, ModelSpec, PredictionSpec, TwinSpec
from evertwin.doctor.finding import Diagnosis
from evertwin.models import Parameters
from evertwin.models.functions.translated import Translated
from evertwin.signals import Layout
from evertwin.twin import Twin
from planted.draws import first_of

STEP, ROWS = 3.0, 2400


def step(x: Any, u: Any, dt: float, p: Any) -> Any:
    level = x[0] + dt * (p[0] * u[0] - x[0]) / p[1]
    return [level], [level]


LEVEL = Layout.of(temperature="1")
MODEL = Translated(
    step, Layout.of(heating="1"), LEVEL, LEVEL, Parameters.of(gain=(20.0, "1"), T=(300.0, "s"))
)
SPEC = TwinSpec(
    "oven", ModelSpec("python"), prediction=PredictionSpec(horizon=60.0),
    arbiter=ArbiterSpec(use="blend"),
)  # fmt: skip


def oven(
    seed: int, tau: float = 300.0, late: int = 0, sensor: Callable[..., Any] | None = None
) -> Diagnosis:
    """The doctor on an oven with a sensor of 1/16 K, whose room is 0.8 K above what it is said."""
    rng = np.random.default_rng(seed)
    heating = np.repeat(rng.integers(0, 2, ROWS // 120).astype(float), 120)
    heating[-800:] = 0.0  # it cools, and stands
    told = np.concatenate([np.zeros(late), heating])[:ROWS]
    y = np.zeros(ROWS)
    for i in range(1, ROWS):
        y[i] = y[i - 1] + STEP * (0.8 + 20.0 * told[i - 1] - y[i - 1]) / tau
    y = np.round(16 * (y + rng.normal(0.0, 0.01, ROWS))) / 16
    if sensor is not None:
        y = sensor(rng, y)
    data = {"t": STEP * np.arange(ROWS), "heating": np.roll(heating, 1), "temperature": y}
    with Twin(SPEC, MODEL) as twin:
        return twin.doctor(data)


@first_of("seed", range(4))
def test_a_temperature_that_stands_within_its_resolution_is_not_frozen(seed: int) -> None:
    found = oven(seed)
    assert not found.of_kind("frozen"), found.text(9)


@first_of("seed", range(4))
@pytest.mark.parametrize("dither", [0.0, 0.03])
def test_a_frozen_sensor_is_named(seed: int, dither: float) -> None:
    def frozen(rng: np.random.Generator, y: np.ndarray) -> np.ndarray:
        y = y + rng.normal(0.0, 0.3, ROWS)
        stands = y[900] + dither * rng.normal(size=300)
        return np.concatenate([y[:900], stands, y[1200:]])

    assert oven(seed, sensor=frozen).of_kind("frozen")


@first_of("seed", range(4))
@pytest.mark.parametrize("first", [0, 900])
def test_values_that_stay_to_the_last_digit_are_named(seed: int, first: int) -> None:
    def frozen(rng: np.random.Generator, y: np.ndarray) -> np.ndarray:
        return np.where(np.arange(ROWS) >= first, y[first] + 20.0, y)

    found = oven(seed, sensor=frozen).of_kind("frozen")
    assert found[0].subject == "temperature" and found[0].evidence["rows"] >= ROWS - first


@first_of("seed", range(4))
def test_a_machine_of_which_nothing_is_asked_stands(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = np.round(rng.normal(0.0, 0.02, ROWS) * 16) / 16
    data = {"t": STEP * np.arange(ROWS), "heating": np.zeros(ROWS), "temperature": y}
    with Twin(SPEC, MODEL) as twin:
        assert not twin.doctor(data).of_kind("frozen")
        data["temperature"] = np.full(ROWS, 5.0)
        assert not twin.doctor(data).of_kind("frozen")


@first_of("seed", range(3))
def test_a_wrong_time_constant_is_no_lag(seed: int) -> None:
    assert not oven(seed, tau=400.0).of_kind("lag")
    (finding,) = oven(seed, late=12).of_kind("lag")
    assert finding.evidence["temperature"]["seconds"] == pytest.approx(36.0, abs=12.0)


@pytest.mark.parametrize("fastest", [80.0, 300.0, 900.0])
@first_of("seed", range(3))
def test_a_motor_turns_as_fast_as_it_is_said_to(seed: int, fastest: float) -> None:
    rng, n, speed = np.random.default_rng(seed), 1200, Layout.of(speed="rad/s")
    current = np.repeat(rng.uniform(0.2, 1.0, n // 40), 40)
    numbers = Parameters.of(gain=(0.8 * fastest, "rad/s/A"), T=(0.5, "s"))
    model = Translated(step, Layout.of(current="A"), speed, speed, numbers)
    _, y = model.simulate(np.zeros(1), current[:, None], np.full(n, 0.1), np.array([fastest, 0.6]))
    data = {
        "t": 0.1 * np.arange(n), "current": np.roll(current, -1),
        "speed": y[:, 0] + rng.normal(0.0, 1e-3 * fastest, n),
    }  # fmt: skip
    spec = TwinSpec("motor", ModelSpec("python"), prediction=PredictionSpec(horizon=2.0))
    with Twin(spec, model) as twin:
        assert not twin.doctor(data).of_kind("unit")
        data["speed"][n // 2 :] *= 30 / np.pi
        assert "rpm for rad/s" in str(twin.doctor(data))


@first_of("seed", range(6))
@pytest.mark.parametrize("unit", ["rad/s/A", "1"])
def test_numbers_that_nobody_stated_are_no_wrong_unit(seed: int, unit: str) -> None:
    rng, n, speed = np.random.default_rng(seed), 1200, Layout.of(speed="rad/s")
    current = np.repeat(rng.uniform(0.2, 1.0, n // 40), 40)
    start = 1e-2 * rng.choice([0.75, 0.85, 1.15, 1.3])  # of what it is: about a power of ten
    model = Translated(
        step, Layout.of(current="A"), speed, speed,
        Parameters.of(gain=(30.0 * start, unit), T=(0.5, "s")),
    )  # fmt: skip
    _, y = model.simulate(np.zeros(1), current[:, None], np.full(n, 0.1), np.array([30.0, 0.6]))
    data = {
        "t": 0.1 * np.arange(n), "current": np.roll(current, -1),
        "speed": y[:, 0] + rng.normal(0.0, 0.03, n),
    }  # fmt: skip
    spec = TwinSpec("motor", ModelSpec("python"), prediction=PredictionSpec(horizon=2.0))
    with Twin(spec, model) as twin:
        found = twin.doctor(data)
    if unit == "1":  # it says itself that it is of the size of one
        assert not found.of_kind("not_tuned")
    else:
        assert found.ranked[0][0].kind == "not_tuned" and not found.of_kind("unit")
