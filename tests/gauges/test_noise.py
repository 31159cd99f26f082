"""What noise alone makes of a deviation is neither learned nor blamed on the form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import AnomalySpec, ModelSpec, ParameterSpec, PredictionSpec, TwinSpec
from evertwin.fold.span import Span
from evertwin.gauges.changes.noise import noise, scatter
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import translated
from evertwin.outcome.result import RunResult
from evertwin.signals import Layout
from evertwin.twin import Twin
from planted.draws import first_of


def run(noise: float, gain: float, seed: int, rows: int = 900) -> RunResult:
    """A cart whose place is measured with noise, 10 mm asked 5 s ahead."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(-0.2, 0.2, rows // 10), 10)
    x = np.r_[0.0, np.cumsum(gain * v[:-1])] + rng.normal(0.0, noise, rows)
    spec = TwinSpec(
        "cart", ModelSpec("robot1d", parameters={"gain": ParameterSpec(1.0, low=0.5, high=1.5)}),
        prediction=PredictionSpec(horizon=5.0), beat=Span(rows=20),
        anomaly=AnomalySpec(requirement=0.01, relative=False, window=Span(rows=300)),
    )  # fmt: skip
    with Twin(spec) as twin:
        return twin.run({"t": np.arange(rows, dtype=np.float64), "v": v, "x": x})


@pytest.mark.parametrize("seed", range(3))
def test_noise_beyond_the_requirement_is_told_and_nothing_is_changed(seed: int) -> None:
    found = run(0.02, 1.0, seed)
    assert found.champion.number == 0 and found.of_kind("noise")
    assert "the noise of x's measurement alone makes" in found.headline


def worse(seed: int, gain: float) -> RunResult:
    """The same, its noise five times as large from row 600 on, or its gain another one from there
    on."""
    rng, rows = np.random.default_rng(seed), 1200
    v = np.repeat(rng.uniform(-0.2, 0.2, rows // 10), 10)
    late = np.arange(rows) >= 600
    x = np.r_[0.0, np.cumsum((np.where(late, gain, 1.0) * v)[:-1])]
    x += rng.normal(0.0, 0.004, rows) * np.where(late & (gain == 1.0), 5.0, 1.0)
    spec = TwinSpec(
        "cart", ModelSpec("robot1d", parameters={"gain": ParameterSpec(1.0, low=0.5, high=1.5)}),
        prediction=PredictionSpec(horizon=5.0), beat=Span(rows=20),
        anomaly=AnomalySpec(requirement=0.01, relative=False, window=Span(rows=600)),
    )  # fmt: skip
    with Twin(spec) as twin:
        return twin.run({"t": np.arange(rows, dtype=np.float64), "v": v, "x": x})


@first_of("seed", range(5))
def test_noise_that_comes_in_a_recording_is_told_as_the_sensors(seed: int) -> None:
    found = worse(seed, 1.0)
    (told, *_) = found.of_kind("noise")
    assert 600 < told.row <= 900 and "the noise of x's measurement" in told.reason
    assert found.champion.number == 0


@first_of("seed", range(5))
def test_a_machine_that_changed_is_not_called_noise(seed: int) -> None:
    found = worse(seed, 1.3)
    assert not found.of_kind("noise") and found.champion.number > 0


def test_a_gain_that_is_off_is_found_beneath_the_noise() -> None:
    found = run(0.02, 1.3, 0)
    assert found.champion.number > 0
    assert abs(found.parameters["gain"].value - 1.3) < 0.03


def test_a_sound_machine_with_little_noise_has_no_such_event() -> None:
    assert not run(0.002, 1.1, 0).of_kind("noise")


def test_drift_is_no_noise() -> None:
    drift = np.sin(np.linspace(0.0, 30.0, 4000)) + np.linspace(0.0, 9.0, 4000)
    assert scatter([np.diff(drift, 2)], static=False) < 0.01


def motor(current_noise: float, requirement: float) -> tuple[Twin, dict[str, np.ndarray]]:
    """A motor whose speed is a state; its current follows from speed and voltage, row by row."""

    def step(x: Any, u: Any, dt: float, p: Any) -> Any:
        speed = x[0] + dt * (p[0] * (u[0] - x[0]))
        return [speed], [speed, p[1] * (u[0] - speed) + 2.0]

    model = translated(FunctionModel(
        step, Layout.of(volts="V"), Layout.of(speed="rad/s", current="A"),
        Layout.of(speed="rad/s"), Parameters.of(pace=(0.5, "1/s"), slope=(0.3, "A/V")),
    ))  # fmt: skip
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(-10.0, 10.0, 60), 20)
    _, y = model.simulate(
        np.zeros(1), u[:, None], np.r_[0.0, np.full(len(u) - 1, 0.1)], np.array([0.5, 0.3])
    )
    y += rng.normal(size=y.shape) * [0.1 * current_noise, current_noise]
    spec = TwinSpec(
        "motor", ModelSpec("python"), prediction=PredictionSpec(horizon=2.0), beat=Span(rows=20),
        anomaly=AnomalySpec(
            requirement=requirement, relative=False, outputs=("current",), window=Span(rows=300)
        ),
    )  # fmt: skip
    held = np.r_[u[1:], u[-1]]  # a command of a row acts from it on
    data = {"t": 0.1 * np.arange(len(u)), "volts": held, "speed": y[:, 0], "current": y[:, 1]}
    return Twin(spec, model), data


@pytest.mark.parametrize("scale", [0.01, 1.0])
def test_an_output_that_no_state_takes_over_has_its_noise_once(scale: float) -> None:
    twin, data = motor(0.2 * scale, 0.18 * scale)
    with twin:
        setup, version = twin.setup, twin.champion
        found = noise(setup, setup.model, version.p, twin.blocks(data))
    assert found == pytest.approx([0.02 * scale, 0.2 * scale], rel=0.1)


def test_noise_of_an_output_that_no_state_takes_over_is_told() -> None:
    twin, data = motor(0.2, 0.18)
    with twin:
        result = twin.run(data)
    assert result.champion.number == 0 and result.of_kind("noise")
    assert not result.of_kind("normal")
