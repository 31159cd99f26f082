"""A sensor that is off by what no one machine explains is named, not told as a wrong form."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.tuning.spec import TuningSpec
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of

ROWS, AT, WINDOW = 4000, 2500, 600


def axis(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[Vector, list[float]]:
    """A mass with dry friction: what drives it."""
    return x, [p[0] * np.sign(u[0]) + 8.0 * u[1]]


def driven(seed: int, offset: float, friction: float) -> RunResult:
    rng = np.random.default_rng(seed)
    t = np.arange(ROWS) * 0.1
    a, b = rng.uniform(0.3, 0.5), rng.uniform(0.9, 1.4)
    speed = np.sin(a * t) + 0.6 * np.sin(b * t + 1.0)
    speedup = a * np.cos(a * t) + 0.6 * b * np.cos(b * t + 1.0)
    late = t >= t[AT]
    dry = np.where(late, friction, 3.0)
    tau = dry * np.sign(speed) + 8.0 * speedup + np.where(late, offset, 0.0)
    data = {"t": t, "v": speed, "a": speedup, "tau": tau + rng.normal(0.0, 0.05, ROWS)}
    model = FunctionModel(
        axis, Layout.of(v="m/s", a="m/s**2"), Layout.of(tau="N"),
        parameters=Parameters.of(Fc=(3.0, "N")),
    )  # fmt: skip
    spec = TwinSpec(
        "axis", ModelSpec("python"), prediction=PredictionSpec(1.0),
        anomaly=AnomalySpec(requirement=0.05, relative=True, window=Span(rows=WINDOW)),
        tuning=TuningSpec(window=Span(rows=WINDOW)),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        return twin.run(data)


@first_of(("seed", "offset"), [(k, by) for k in range(4) for by in (1.0, -0.8, 2.0)])
def test_an_offset_that_friction_does_not_explain_is_named_at_once(
    seed: int, offset: float
) -> None:
    result = driven(seed, offset, 3.0)
    said = [e for e in result.events if e.signal == "tau" and "looks off by" in e.reason]
    assert said and AT < said[0].row < AT + WINDOW
    assert not result.of_kind("promoted")
    assert "[correction]" not in result.headline and "tau looks off by" in result.headline


@pytest.mark.parametrize("seed", range(2))
def test_friction_that_changes_is_learned_all_the_same(seed: int) -> None:
    result = driven(seed, 0.0, 4.0)
    assert abs(result.parameters["Fc"].value - 4.0) < 0.1
