"""A hidden speed, and numbers of which only ratios are told: force, mass, friction of a slide."""

from __future__ import annotations

from math import tanh
from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters, RunResult, Twin, TwinSpec
from evertwin.config import spec
from planted.draws import first_of

DT, ROWS = 0.01, 4000
TRUE = {"area": 7e-4, "mass": 4.0, "viscous": 90.0, "coulomb": 20.0, "weight": 15.0}
UNITS = {"area": "m^2", "mass": "kg", "viscous": "N*s/m", "coulomb": "N", "weight": "N"}


def step(x: Any, u: Any, dt: float, p: Any) -> Any:
    """A cylinder moved by a difference of pressure, its place measured."""
    place, speed = x[0], x[1]
    for _ in range(4):
        force = p[0] * u[0] - p[2] * speed - p[3] * tanh(speed / 0.01) - p[4]
        speed += dt / 4 * force / p[1]
        place += dt / 4 * speed
    return [place, speed], [place]


def slide(seed: int, *, off: float) -> tuple[FunctionModel, dict[str, Any]]:
    """A model whose numbers are off by such a factor's logarithm at most, and its recording."""
    rng = np.random.default_rng(seed)
    true = np.array(list(TRUE.values())) * np.exp(rng.uniform(-0.3, 0.3, len(TRUE)))
    guess = true * np.exp(rng.uniform(-off, off, len(TRUE)))
    aim = np.repeat(rng.uniform(-0.15, 0.15, ROWS // 80 + 1), 80)[:ROWS]
    x, places, pressures = [0.0, 0.05], [], []
    for k in range(ROWS):  # a controller holds it near where it shall be
        places.append(x[0])
        force = true[4] + 700.0 * (aim[k] - x[0]) - 30.0 * x[1]
        pressures.append(np.clip(force, -90.0, 120.0) / true[0])
        x = step(x, pressures[-1:], DT, true)[0]
    named = zip(TRUE, guess.tolist(), strict=True)
    model = FunctionModel(
        step, Layout.of(pressure="Pa"), Layout.of(place="m"), Layout.of(place="m", speed="m/s"),
        Parameters.of(**{name: (value, UNITS[name]) for name, value in named}),
    )  # fmt: skip
    noisy = np.array(places) + rng.normal(0.0, 1e-4, ROWS)
    return model, {"t": np.arange(ROWS) * DT, "pressure": np.array(pressures), "place": noisy}


def ran(model: FunctionModel, data: dict[str, Any]) -> RunResult:
    watch = spec.AnomalySpec(requirement=2e-3, relative=False, window=spec.Span(300))
    short = spec.PredictionSpec(horizon=0.4)
    about = TwinSpec(
        "slide", spec.ModelSpec("python"), beat=spec.Span(100), prediction=short, anomaly=watch
    )
    return Twin(about, model).run(data)


@first_of("seed", range(6))
@pytest.mark.parametrize("off", [0.4, 0.0])
def test_ratios_that_are_told_go_live(seed: int, off: float) -> None:
    result = ran(*slide(seed, off=off))
    promoted = result.of_kind("promoted")
    assert bool(promoted) == (off > 0.0), str(result)
    if promoted:
        assert "area" in promoted[-1].reason and "weak" in promoted[-1].reason
        assert result.headline.startswith("The twin fits its machine now"), str(result)
