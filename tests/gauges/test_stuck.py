"""A command that no longer changes: its signal is gone, or it is held."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.correction.spec import CorrectionSpec
from evertwin.models import Parameters
from evertwin.models.functions.translated import translated
from evertwin.tuning.spec import TuningSpec
from planted.draws import first_of

AT, ROWS = 1500, 3000


def step(x: Any, u: Any, dt: float, p: Any) -> tuple[Any, Any]:
    speed = x[0] + dt * (p[0] * u[0] - p[1] * x[0])
    return [speed], [speed]


def driven(gain: float, *, frozen: bool, held: bool, before: float = np.nan) -> RunResult:
    """A belt by steps of current, ``gain`` times as strong from AT on; there the recorded current
    freezes, or the true one is held. Long ``before`` it was held, too, so far from where it is."""
    rng, x = np.random.default_rng(2), 0.0
    true = np.repeat(rng.uniform(2.0, 9.0, ROWS // 10), 10)
    true[50:450] = np.where(np.isnan(before), true[50:450], true[AT] + before)
    if held:
        true[AT:] = true[AT]
    y = np.empty(ROWS)
    for k in range(ROWS):
        x += 0.1 * ((gain if k >= AT else 1.0) * 0.15 * true[k] - 0.5 * x)
        y[k] = x
    u = np.where(frozen & (np.arange(ROWS) >= AT), true[AT], true)
    given = Parameters.of(push=(0.15, "m/s^2/A"), viscous=(0.5, "1/s"))
    speed = Layout.of(v="m/s")
    model = translated(FunctionModel(step, Layout.of(i="A"), speed, speed, given))
    spec = TwinSpec(
        "belt", ModelSpec("given"), anomaly=AnomalySpec(requirement=0.05, window=Span(200)),
        prediction=PredictionSpec(horizon=1.0), tuning=TuningSpec(window=Span(600)),
        beat=Span(20), correction=CorrectionSpec(window=Span(600)),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        noisy = y + 0.01 * rng.normal(size=ROWS)
        return twin.run({"t": 0.1 * np.arange(ROWS), "i": u, "v": noisy})


def test_a_current_that_froze_is_named_and_nothing_is_learned() -> None:
    result = driven(1.0, frozen=True, held=False)
    told = [e for e in result.of_kind("abnormal") if e.signal == "i"]
    assert told and "i has not changed since row 1501" in told[0].reason
    assert told[0].row < AT + 500 and not result.of_kind("promoted")
    assert "has not changed" in result.headline


@first_of(("before", "named"), [(0.5, True), (0.0, False)])
def test_a_current_that_was_held_there_as_long_before_is_not_named(
    before: float, named: bool
) -> None:
    """Though it is so long ago that no kept row tells of it; that it was held elsewhere does not
    count."""
    result = driven(1.0, frozen=True, held=False, before=before)
    assert bool([e for e in result.of_kind("abnormal") if e.signal == "i"]) is named


@pytest.mark.parametrize("held", [True, False])
def test_a_command_may_be_held_while_a_belt_gets_weaker(held: bool) -> None:
    result = driven(0.6, frozen=False, held=held)
    assert not [e for e in result.events if e.signal == "i"]
    assert held or result.of_kind("promoted")


def turned(x: Any, u: Any, dt: float, p: Any) -> tuple[Any, Any]:
    heading = x[0] + dt * p[0] * u[0] * u[1]
    return [heading], [heading]


def steered(seed: int, fault: str, gain: float = 1.0) -> RunResult:
    """A tug by a measured angle of its wheel, whose sensor stays where it is from AT on; or which
    turns ``gain`` times as much then."""
    rng, angle, heading, goal, speed = np.random.default_rng(seed), 0.1, 0.0, 0.1, 1.0
    data = np.empty((ROWS, 3))
    for k in range(ROWS):
        goal = rng.uniform(-0.5, 0.5) if k % 40 == 0 else goal
        speed = rng.uniform(0.5, 1.5) if k % 70 == 0 else speed
        angle += np.clip(goal - angle, -0.05, 0.05)
        heading += 0.1 * 0.7 * (gain if k >= AT else 1.0) * speed * angle
        data[k] = speed, angle, heading
    data += rng.normal(0.0, (0.0, 0.002, 0.003), (ROWS, 3))
    stays = data[AT, 1] + {
        "exact": np.zeros(ROWS - AT), "digits": 0.004 * rng.integers(0, 2, ROWS - AT),
        "scatter": rng.normal(0.0, 0.002, ROWS - AT), "": data[AT:, 1] - data[AT, 1],
    }[fault]  # fmt: skip
    data[AT:, 1] = stays
    given = Parameters.of(turn=(0.7, "1/m"))
    layout = Layout.of(heading="rad")
    inputs = Layout.of(speed="m/s", angle="rad")
    model = translated(FunctionModel(turned, inputs, layout, layout, given))
    spec = TwinSpec(
        "tug", ModelSpec("given"), prediction=PredictionSpec(horizon=1.5), beat=Span(20),
        anomaly=AnomalySpec(requirement=0.08, relative=False, window=Span(300)),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        return twin.run(dict(zip(("speed", "angle", "heading"), data.T, strict=True)) | {
            "t": 0.1 * np.arange(ROWS)})  # fmt: skip


@first_of("seed", [1, 2, 3])
@pytest.mark.parametrize("fault", ["exact", "digits", "scatter"])
def test_a_measured_angle_that_stays_where_it_is_is_named(fault: str, seed: int) -> None:
    """Where a tug turns either way, an angle that stays is next to no gain of its steering."""
    result = steered(seed, fault)
    told = [e for e in result.of_kind("abnormal") if e.signal == "angle"]
    assert told and told[0].evidence["number"] == 0.0 and "goes on as if it had" in told[0].reason
    assert not result.of_kind("promoted", "tuned")


@pytest.mark.parametrize("seed", [1, 2])
def test_a_tug_that_turns_less_is_tuned(seed: int) -> None:
    result = steered(seed, "", gain=0.6)
    assert result.of_kind("promoted") and not [e for e in result.events if e.signal == "angle"]
