"""What was not judged is said first, and why; what is measured more seldom is not missed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec, TwinSpec
from evertwin.machines.thermal import ThermalBox
from evertwin.outcome.open.unjudged import unjudged
from evertwin.outcome.result import RunResult
from evertwin.twin import Twin

SPEC = TwinSpec(
    "robot", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
    anomaly=AnomalySpec(requirement=0.05, relative=False),
)  # fmt: skip
ROWS = 1500


def drive(
    seed: int, lost: str = "", first: int = 0, stop: int = ROWS, every: int = 1,
    spec: TwinSpec = SPEC,
) -> RunResult:  # fmt: skip
    """Without a value of the channel ``lost`` from row ``first`` to ``stop``; x is measured at
    ``every`` so many rows."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(-0.2, 0.2, ROWS // 30), 30)
    x = np.r_[0.0, np.cumsum(0.1 * v)[:-1]] + rng.normal(0.0, 0.001, ROWS)
    x[np.arange(ROWS) % every != 0] = np.nan
    rows = {"t": 0.1 * np.arange(ROWS), "v": v, "x": x}
    if lost:
        rows[lost][first:stop] = np.nan
    with Twin(spec) as twin:
        return twin.run(rows)


@pytest.mark.parametrize("seed", range(3))
def test_what_has_no_value_is_said_first(seed: int) -> None:
    half = drive(seed, "x", 750).headline
    assert half.startswith(
        "Without a value, nothing of x was judged in 50 % of the rows (row 750 to 1499). The twin "
    )
    command = drive(seed, "v", 300, 600).headline
    assert command.startswith("Without a value of v, nothing was predicted in 20 % of the rows")
    none = drive(seed, "x").headline
    assert none.startswith("Without a value, nothing of x was judged in any row. Nothing was")


def box(**sections: Any) -> RunResult:
    """A heated box, whose heater's temperature nothing measures; ``sections`` of its twin."""
    rng, n = np.random.default_rng(4), 600
    model = ThermalBox(wall=False)
    u = np.column_stack([np.repeat(rng.integers(0, 2, n // 30), 30) * 1.0, np.full(n, 294.0)])
    p = model.parameters.values
    _, y = model.simulate(model.initial(p), u, np.full(n, 3.0), p)
    rows = {"t": 3.0 * np.arange(n), **dict(zip(model.inputs.names, u.T, strict=True))}
    spec = TwinSpec("box", ModelSpec("thermal", options={"wall": False}), **sections)
    with Twin(spec) as twin:
        return twin.run({**rows, "box": y[:, 0] + rng.normal(0.0, 0.02, n)})


def test_a_prediction_that_never_ends_is_the_cause_that_is_named() -> None:
    asked = AnomalySpec(requirement=0.5, relative=False)
    never = box(anomaly=asked)
    assert never.headline.startswith(
        "Nothing was judged: by the first prediction behind a start what nothing measures (heater) "
        "is estimated, and it never ends: set [prediction] horizon"
    )
    long = box(anomaly=asked, prediction=PredictionSpec(horizon=3000.0))
    assert "takes 3000 s" in long.headline and not (never.judged or long.judged)
    assert box(anomaly=asked, prediction=PredictionSpec(horizon=30.0)).judged


@pytest.mark.parametrize("every", [1, 2, 7, 40])
def test_what_is_measured_more_seldom_is_not_missed(every: int) -> None:
    assert drive(0, every=every).headline.startswith("The twin fits its machine")
    assert drive(0, "x", 0, 100, every).headline.startswith("The twin fits its machine")
    assert (
        "Without a value, nothing of x was judged in 2" in drive(0, "x", 600, 910, every).headline
    )


def test_rows_that_were_left_out_of_the_trace_are_not_missed() -> None:
    """Of every second row, an output that is measured at the others is never there."""
    with Twin(SPEC) as twin:
        rows, no = np.arange(0, 200, 2), np.full((100, 1), np.nan)
        trace = {"row": rows, "input": np.zeros((100, 1)), "measured": no}
        assert unjudged(twin.setup, trace) == "" == unjudged(twin.setup, {})
        assert "any row" in unjudged(twin.setup, {**trace, "row": np.arange(100)})


@pytest.mark.parametrize("seed", range(2))
def test_rows_at_which_nothing_moved_tell_no_fit(seed: int) -> None:
    noise, n = np.random.default_rng(seed).normal(0.0, 0.001, ROWS), ROWS
    with Twin(SPEC) as twin:
        still = twin.run({"t": 0.1 * np.arange(n), "v": np.zeros(n), "x": 2.0 + noise}).headline
    assert still.startswith("Nothing moved, so whether the twin fits cannot be told")


@pytest.mark.parametrize("limit", [0.05, 0.0005])
def test_what_is_off_by_more_than_is_asked_is_missed(limit: float) -> None:
    """Noise alone makes more than is asked, and no model is to blame: it is missed all the same."""
    spec = replace(SPEC, anomaly=replace(SPEC.anomaly, requirement=limit))
    result = drive(1, spec=spec)
    assert result.missed == (("x",) if limit < 0.01 else ())
    assert result.headline.startswith("The twin does not fit its machine") == bool(result.missed)
