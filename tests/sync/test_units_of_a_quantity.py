"""A factor is that of units of its quantity, unless another fits better than the noise explains."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from evertwin.signals.mistaken import FACTORS, PURE, TURN, Factor, numbers
from evertwin.sync import Track, places

N, H, CHANGED = 600, 0.1, 300


def fan(x: Any, u: Any, dt: float, p: Any) -> tuple[list[float], list[float]]:
    speed = x[0] + dt * (p[0] * u[0] - x[0]) / 2.0
    return [speed], [speed]


def told(unit: str, factor: float, seed: int) -> tuple[float, str]:
    """The factor that is suspected, and in words."""
    rng = np.random.default_rng(seed)
    out = Layout.of(speed=unit)
    model = FunctionModel(fan, Layout.of(i="A"), out, out, Parameters.of(gain=(15.0, "1")))
    u = np.repeat(rng.uniform(3.0, 8.0, N // 30), 30)[:, None]
    _, y = model.simulate(np.zeros(1), u, np.full(N, H), model.parameters.values)
    y += rng.normal(0.0, 0.1, y.shape)
    y[CHANGED:] *= factor
    track = Track(model)
    block = make_block(t=(np.arange(N) * H * 1e9).astype(np.int64), u=u, y=y)
    records = track.step(track.init(), block)[1].records
    (found,) = [one for one in records if one.evidence.get("cause") == "factor"]
    return found.evidence["factor"], found.reason


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("unit", "factor", "said"),
    [
        ("rad/s", 30 / np.pi, "9.5493 (rpm for rad/s)"),
        ("rad/s", np.pi / 30, "(rad/s for rpm)"),
        ("rad/s", 180 / np.pi, "180/π (degrees for radians)"),
        ("rad/s", 60.0, "60"),
        ("rad/s", 10.0, "factor of 10"),
        ("N", 9.80665, "(newtons for kilograms)"),
        ("N", 10.0, "factor of 10"),
        ("m", 10.0, "factor of 10"),
        ("m", 3.28084, "(feet for metres)"),
        ("Nm", 1 / 8.85075, "newton metres for inch pounds"),
        ("Pa", 14.5038, "psi for bars"),
        ("m/s", 3.6, "km/h for m/s"),
        ("m^3/s", 3.78541, "litres for gallons"),
    ],
)
def test_units_of_the_quantity_are_named_first(
    unit: str, factor: float, said: str, seed: int
) -> None:
    found, reason = told(unit, factor, seed)
    assert found == pytest.approx(factor, rel=1e-4)
    assert said in reason


@pytest.mark.parametrize("one", FACTORS, ids=lambda one: one.said)
def test_the_stream_tries_the_factors_of_a_fit_that_no_machine_changes_by(one: Factor) -> None:
    tried = [unit for unit in one.units or ("W",) if one.number in suspected(unit)]
    least = places.PUSHED if {"N", "Nm"} & {*one.units} else PURE  # a push does as much
    assert tried == ([] if 0.0 < one.number < least else [*(one.units or ("W",))])
    other = "kg" if "kg" not in one.units else "V"
    assert (one.number in suspected(other)) == (not one.units or one.number == TURN)


def suspected(unit: str) -> list[float]:
    """Factors that a channel of a unit is suspected of in the stream: a fit tries them, too."""
    out = Layout.of(speed=unit)
    track = Track(FunctionModel(fan, Layout.of(i="A"), out, out, Parameters.of(gain=(15.0, "1"))))
    found = places.FACTORS[track._settings[0][0, places.TRIED :] != places.NEVER].tolist()
    assert set(found) <= {TURN, *(number for number, _ in numbers(unit))}
    return found
