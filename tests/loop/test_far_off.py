"""A model whose numbers are three times off is brought to its machine by `run`, as by `fit`."""

from __future__ import annotations

from math import exp
from typing import Any

import numpy as np

from evertwin import FunctionModel, Layout, Parameters, Twin, TwinSpec
from evertwin.config import spec
from evertwin.fold.span import Span
from planted.draws import first_of

HEAT, STATES = Layout.of(T="1"), Layout.of(c="1", T="1")
PULL, MOVES = Layout.of(a="1"), Layout.of(a="1", v="1")


def reactor(x: Any, u: Any, dt: float, p: Any) -> Any:
    """Ignites: with numbers that are far off it runs away."""
    c, heat = x
    for _ in range(8):
        rate = p[0] * c * exp(p[1] * (1.0 - 350.0 / max(heat, 200.0)))
        c += dt / 8 * (1.0 - c - rate)
        heat += dt / 8 * (350.0 - heat + 200.0 * rate + p[2] * (u[0] - heat))
    return [c, heat], [heat]


def oscillator(x: Any, u: Any, dt: float, p: Any) -> Any:
    """Van der Pol's."""
    a, v = x
    for _ in range(10):
        v += dt / 10 * (p[0] * (1.0 - a * a) * v - p[1] * a + p[2] * u[0])
        a += dt / 10 * v
    return [a, v], [a]


def ran(model: FunctionModel, true: np.ndarray, x0: list[float], u: np.ndarray, dt: float) -> Any:
    y, x = np.empty(len(u)), [*x0]
    for i, command in enumerate(u):
        y[i] = x[-1 if model.outputs.names == ("T",) else 0]
        x = model.step(x, [command], dt, true)[0]
    y += 0.01 * y.std() * np.random.default_rng(0).normal(size=len(y))
    asked = spec.AnomalySpec(requirement=0.05, window=Span(300))
    ahead = spec.PredictionSpec(horizon=20 * dt)
    twin = Twin(TwinSpec("one", spec.ModelSpec("python"), prediction=ahead, anomaly=asked,
                         beat=Span(40)), model)  # fmt: skip
    data = {"t": dt * np.arange(len(u)), model.inputs.names[0]: u, model.outputs.names[0]: y}
    return twin.run(data)


@first_of("seed", range(3))
def test_a_reactor_that_runs_away(seed: int) -> None:
    rng = np.random.default_rng(seed)
    true = np.array([1.35, 17.0, 1.6]) * np.exp(rng.uniform(-0.1, 0.1, 3))
    off = dict(zip(("k0", "E", "UA"), (true * [1 / 3, 3.0, 3.0]).tolist(), strict=True))
    parameters = Parameters.of(**{name: (value, "1") for name, value in off.items()})
    model = FunctionModel(reactor, Layout.of(cool="1"), HEAT, STATES, parameters, (0.7, 340.0))
    u = np.repeat(rng.uniform(275.0, 315.0, 100), 30)
    result = ran(model, true, [0.6, 345.0], u, 0.1)
    assert result.outputs["T"].judged < 0.05, str(result)


@first_of("seed", range(3))
def test_an_oscillator(seed: int) -> None:
    rng = np.random.default_rng(seed)
    true = np.array([1.0, 9.0, 3.0]) * np.exp(rng.uniform(-0.3, 0.3, 3))
    off = dict(zip(("mu", "w2", "b"), (true * [3.0, 3.0, 1 / 3]).tolist(), strict=True))
    parameters = Parameters.of(**{name: (value, "1") for name, value in off.items()})
    model = FunctionModel(oscillator, Layout.of(u="1"), PULL, MOVES, parameters)
    u = np.repeat(rng.uniform(-1.0, 1.0, 80), 25)
    result = ran(model, true, [0.5, 1.0], u, 0.05)
    assert result.outputs["a"].judged < 0.05, str(result)
