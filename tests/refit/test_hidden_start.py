"""A battery cell whose charge nothing measures, and whose resistance rises by two fifths."""

from __future__ import annotations

import numpy as np

from evertwin import FunctionModel, Layout, Parameters, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.models.functions.translated import translated
from evertwin.sync.spec import SignalSpec
from evertwin.tuning.spec import TuningSpec
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of

ROWS, AT = 5000, 2200


def discharged(
    x: Vector, u: Vector, dt: float, p: ParameterVector
) -> tuple[list[float], list[float]]:
    charge = x[0] - dt * u[0] / 9000.0
    return [charge], [3.2 + 0.9 * charge - p[1] * u[0]]


def cell(seed: int, start: float | str) -> RunResult:
    rng = np.random.default_rng(seed)
    current = np.repeat(rng.uniform(-2.0, 3.0, ROWS // 40), 40)
    resistance = np.where(np.arange(ROWS) < AT, 0.025, 0.035)
    voltage = 3.2 + 0.9 * (0.9 - np.cumsum(current) / 9000.0) - resistance * current
    data = {
        "t": np.arange(float(ROWS)), "current": current,
        "voltage": voltage + rng.normal(0.0, 2e-3, ROWS),
    }  # fmt: skip
    model = translated(FunctionModel(
        discharged, Layout.of(current="A"), Layout.of(voltage="V"), Layout.of(charge="1"),
        Parameters.of(charged=(0.9, "1"), resistance=(0.025, "Ohm")), start=(start,),
    ))  # fmt: skip
    spec = TwinSpec(
        "cell", ModelSpec("python"), beat=Span(seconds=60.0), prediction=PredictionSpec(60.0),
        signals={"current": SignalSpec(hold=False)},
        anomaly=AnomalySpec(requirement=0.01, relative=False, window=Span(seconds=600.0)),
        tuning=TuningSpec(window=Span(seconds=1500.0), editable=("charged", "resistance")),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        return twin.run(data)


@first_of("start", ["charged", 0.9])
@first_of("seed", range(3))
def test_a_change_is_told_and_tuned(seed: int, start: float | str) -> None:
    result = cell(seed, start)
    assert result.of_kind("changed") and result.of_kind("promoted")
    assert abs(result.parameters["resistance"].value - 0.035) < 1e-3
    assert not [e for e in result.of_kind("abnormal") if "number" in e.evidence]
