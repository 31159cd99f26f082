"""A machine that something drives of which the model knows nothing: no version lasts."""

from __future__ import annotations

import numpy as np

from evertwin import Twin
from evertwin.config.spec import AnomalySpec, ModelSpec, ParameterSpec, PredictionSpec, TwinSpec


def told(loads: list[float]) -> str:
    """Of a drive with these loads, one after the other, for 90 s each."""
    rng, n = np.random.default_rng(3), 900 * len(loads)
    t = np.arange(n) * 0.1
    v = np.sin(0.9 * t) + 0.7 * np.sin(0.37 * t + 1.0)
    a = 0.9 * np.cos(0.9 * t) + 0.7 * 0.37 * np.cos(0.37 * t + 1.0)
    force = 20.0 * a + 9.0 * v + np.repeat(loads, 900) + rng.normal(0.0, 0.1, n)
    values = {"mass": 20.0, "Fv": 9.0, "Fc": 0.0, "offset": loads[0]}
    model = ModelSpec("drive_force", {}, {k: ParameterSpec(value=x) for k, x in values.items()})
    spec = TwinSpec(
        "hoist", model, prediction=PredictionSpec(horizon=1.0),
        anomaly=AnomalySpec(requirement=0.05),
    )  # fmt: skip
    with Twin(spec) as twin:
        return twin.run({"t": t, "speed": v, "acceleration": a, "force": force}).headline


def test_a_load_that_no_input_tells_of_is_named_where_no_version_lasts() -> None:
    said = "versions in turn were live for"
    assert said in told([30.0, 55.0, 12.0, 80.0, 40.0, 5.0])
    assert said not in told([30.0, 30.0, 55.0, 55.0])
