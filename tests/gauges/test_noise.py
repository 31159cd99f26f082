"""What noise alone makes of a deviation is neither learned nor blamed on the form."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.config.spec import AnomalySpec, ModelSpec, ParameterSpec, PredictionSpec, TwinSpec
from evertwin.fold.span import Span
from evertwin.gauges.noise import scatter
from evertwin.outcome.result import RunResult
from evertwin.twin import Twin


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


def test_a_gain_that_is_off_is_found_beneath_the_noise() -> None:
    found = run(0.02, 1.3, 0)
    assert found.champion.number > 0
    assert abs(found.parameters["gain"].value - 1.3) < 0.03


def test_a_sound_machine_with_little_noise_has_no_such_event() -> None:
    assert not run(0.002, 1.1, 0).of_kind("noise")


def test_drift_is_no_noise() -> None:
    drift = np.sin(np.linspace(0.0, 30.0, 4000)) + np.linspace(0.0, 9.0, 4000)
    assert scatter([np.diff(drift, 2)], static=False) < 0.01
