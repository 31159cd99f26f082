"""Starts that are far off: a rough search over the bounds finds what no step from there does."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters, Twin, TwinSpec
from evertwin.config import spec
from evertwin.models import Parameter
from planted.draws import first_of

TWINS = Path(__file__).parents[2] / "twins"


def mass() -> FunctionModel:
    """That of `twins/mass.py`: a mass with dry friction, stiff."""
    found = importlib.util.spec_from_file_location("mass_of_the_twins", TWINS / "mass.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    model: FunctionModel = module.model
    return model


def tanks(x: Any, u: Any, dt: float, p: Any) -> Any:
    upper, lower = x
    for _ in range(8):
        flow = p[2] * max(upper, 0.0) ** 0.5
        upper += dt / 8 * (u[0] - flow) / p[0]
        lower += dt / 8 * (flow - p[3] * max(lower, 0.0) ** 0.5) / p[1]
    return [upper, lower], [upper, lower]


def driven(
    model: FunctionModel, true: dict[str, float], seed: int, input_: tuple[float, float]
) -> Any:
    """(twin from 25 times off, each number up or down, within 25 times; 1,000 rows, the truth)."""
    rng = np.random.default_rng([3, seed])
    start = {name: v * 25.0 ** rng.choice([-1, 1]) for name, v in true.items()}
    items = {item.name: item for item in model.parameters}
    numbers = Parameters(tuple(
        Parameter(n, start[n], items[n].unit, true[n] / 25, true[n] * 25) for n in true
    ))  # fmt: skip
    model = FunctionModel(model.step, model.inputs, model.outputs, model.states, numbers)
    low, high = input_
    dt, u = 0.02 if low < 0 else 4.0, np.repeat(rng.uniform(low, high, 50), 20)
    x, y = [0.3, 0.3] if low >= 0 else [0.0, 0.0], np.empty((1000, 2))
    for k in range(1000):
        y[k] = x
        for _ in range(4):
            x = model.step(x, [u[k]], dt / 4, list(true.values()))[0]
    y += 0.01 * y.std(axis=0) * rng.normal(size=y.shape)
    names = (*model.outputs.names, model.inputs.names[0])
    columns = dict(zip(names, (*y.T, u), strict=True))
    horizon = spec.PredictionSpec(horizon=25 * dt)
    twin = Twin(TwinSpec("far", spec.ModelSpec("python"), prediction=horizon), model)
    return twin, {"t": dt * np.arange(1000), **columns}


CASES = {
    "mass": (lambda: mass(), {"mass": 2.0, "fc": 1.5, "fv": 0.5}, (-8.0, 8.0)),
    "tanks": (
        lambda: FunctionModel(
            tanks, Layout.of(q="1"), Layout.of(a="1", b="1"), Layout.of(a="1", b="1"),
            Parameters.of(A1=(1.0, "1"), A2=(1.0, "1"), k1=(1.0, "1"), k2=(1.0, "1")),
        ),
        {"A1": 0.5, "A2": 0.3, "k1": 0.01, "k2": 0.012}, (0.0005, 0.01),
    ),
}  # fmt: skip


@first_of("seed", [2, 4, 9, 10])
@pytest.mark.parametrize("case", CASES)
def test_numbers_from_25_times_off(case: str, seed: int) -> None:
    """A search from the start alone calls 3 of 24 masses and 9 of 24 tanks identifiable, 20 to
    3,000 % off."""
    made, true, reach = CASES[case]
    twin, data = driven(made(), true, seed, reach)
    fit = twin.fit(data).fit
    for name, value in true.items():
        assert fit[name] == pytest.approx(value, rel=0.1), str(fit)
    assert fit.verdict[:2] == ("identifiable",) * 2, str(fit)


def test_a_start_at_which_the_simulation_runs_away() -> None:
    def swings(x: Any, u: Any, dt: float, p: Any) -> Any:
        speed = x[1] + dt * (u[0] - p[0] * x[1] - p[1] * x[0])
        return [x[0] + dt * speed, speed], [x[0] + dt * speed, speed]

    rng, x, y = np.random.default_rng(0), [0.0, 0.0], np.empty((500, 2))
    u = np.repeat(rng.uniform(-1.0, 1.0, 25), 20)
    for k in range(500):
        y[k] = x
        x, _ = swings(x, [u[k]], 0.05, [2.0, 30.0])
    y += 0.002 * rng.normal(size=y.shape)
    named = Parameters.of(d=(60.0, "1/s"), k=(900.0, "1/s^2"))
    states = Layout.of(x="m", v="m/s")
    model = FunctionModel(swings, Layout.of(a="m/s^2"), states, states, named)
    twin = Twin(TwinSpec("spring", spec.ModelSpec("python")), model)
    fit = twin.fit({"t": 0.05 * np.arange(500), "a": u, "x": y[:, 0], "v": y[:, 1]}).fit
    assert fit.verdict == ("identifiable", "identifiable"), str(fit)
    assert fit.p == pytest.approx([2.0, 30.0], rel=0.05)
