"""A machine that changes while its twin is off by more than is asked already."""

from __future__ import annotations

import numpy as np

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ModelSpec, ParameterSpec, PredictionSpec
from evertwin.fold.span import Span
from evertwin.outcome.result import RunResult
from evertwin.tuning.spec import TuningSpec
from planted.draws import first_of

ROWS, AT, STEP = 9000, 6000, 0.1


def run(seed: int, gain: float, requirement: float = 0.004) -> RunResult:
    """A cart that slips the more the faster it goes, which the form of its twin does not know; from
    row `AT` on it does ``gain`` of what it did."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(-0.5, 0.5, ROWS), rng.integers(10, 50, ROWS))[:ROWS]
    way = v * (1.0 - 0.5 * np.abs(v)) * np.where(np.arange(ROWS) >= AT, gain, 1.0)
    x = np.r_[0.0, np.cumsum(way[1:] * STEP)] + rng.normal(0.0, 0.0005, ROWS)
    spec = TwinSpec(
        "cart", ModelSpec("robot1d", parameters={"gain": ParameterSpec(1.0, low=0.2, high=1.5)}),
        prediction=PredictionSpec(horizon=1.0), beat=Span(rows=20),
        anomaly=AnomalySpec(requirement=requirement, relative=False, window=Span(rows=1000)),
        tuning=TuningSpec(window=Span(rows=3000)),
    )  # fmt: skip
    with Twin(spec) as twin:
        return twin.run({"t": np.arange(ROWS) * STEP, "v": v, "x": x})


@first_of("requirement", [0.004, 0.002, 0.008])
@first_of("seed", range(4))
def test_the_change_is_told_within_a_minute(seed: int, requirement: float) -> None:
    found = run(seed, 0.6, requirement)
    assert not any(e.row < AT for e in found.of_kind("changed"))
    first = next(e for e in found.of_kind("changed") if e.row >= AT)
    assert first.row <= AT + 600 and abs(first.evidence["row"] - AT) < 60


@first_of("seed", range(4))
def test_a_machine_that_stays_as_it_is_has_not_changed(seed: int) -> None:
    found = run(seed, 1.0)
    assert not found.of_kind("changed")
    assert not any("times what it was" in e.reason for e in found.of_kind("suspected"))
