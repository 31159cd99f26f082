"""An output that goes by its input itself leaps with it, a row before the model does: no fault."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin import FunctionModel, Layout, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec
from evertwin.models import Parameters
from planted.draws import first_of

SPIKES = (612, 1333)


def motor(x: Any, u: Any, dt: float, p: Any) -> Any:
    speed = x[0] + dt * (u[0] - x[0]) / p[0]
    return [speed], [speed, u[0] - 0.5 * speed]


def recorded(seed: int, spikes: bool) -> dict[str, np.ndarray]:
    """Speed and current of a motor at steps of its voltage; both are of the moment of the row."""
    rng, n, dt = np.random.default_rng(seed), 2000, 0.01
    u = np.repeat(rng.uniform(-20.0, 20.0, n // 40), 40)
    speed = np.zeros(n)
    for i in range(1, n):
        speed[i] = speed[i - 1] + dt * (u[i - 1] - speed[i - 1]) / 0.3
    current = u - 0.5 * speed + rng.normal(0.0, 0.1, n)
    current[list(SPIKES)] += 30.0 * spikes
    speed = speed + rng.normal(0.0, 0.05, n)
    return {"t": np.arange(n) * dt, "u": u, "speed": speed, "current": current}


@first_of(("seed", "spikes"), [(1, False), (2, True), (3, False), (4, True)])
def test_a_leap_that_the_input_explains_is_no_error_and_a_spike_is(seed: int, spikes: bool) -> None:
    model = FunctionModel(
        motor, Layout.of(u="V"), Layout.of(speed="rad/s", current="A"), Layout.of(speed="rad/s"),
        Parameters.of(lag=(0.3, "s")),
    )  # fmt: skip
    asked = AnomalySpec(requirement=0.2, relative=True)
    spec = TwinSpec(
        "motor", ModelSpec("given"), prediction=PredictionSpec(horizon=0.5), anomaly=asked
    )
    with Twin(spec, model) as twin:
        found = twin.run(recorded(seed, spikes)).of_kind("measurement_error")
    told = [(event.row, event.signal) for event in found]
    assert told == [(row + 1, "current") for row in SPIKES if spikes], told
