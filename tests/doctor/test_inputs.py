"""An input that was measured at its row and is taken for a command, of a motor."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import translated
from evertwin.signals import Layout
from planted.draws import first_of

STEP = 0.05


def motor() -> FunctionModel:
    """The current turns a shaft with friction."""

    def step(x: Any, u: Any, dt: float, p: Any) -> Any:
        k, d = p
        ahead = x[0] * np.exp(-d * dt) + k * u[0] * dt
        return [ahead], [ahead]

    w = Layout.of(w="rad/s")
    numbers = Parameters.of(k=(8.0, "rad/s^2/A"), d=(2.0, "1/s"))
    return translated(FunctionModel(step, Layout.of(i="A"), w, w, numbers))


def told(seed: int, *, commanded: bool, hold: bool | None = None) -> list[str]:
    """Kinds that the doctor names; the current of a row acts into it, or from it on."""
    rng, n = np.random.default_rng(seed), 600
    i = np.cumsum(rng.normal(0, 0.02, n))
    i -= np.linspace(i[0], i[-1], n)
    acts = np.concatenate([i[:1], i[:-1]]) if commanded else i
    model, x = motor(), np.zeros(n)
    for row in range(1, n):
        x[row] = model.step(x[row - 1 : row], acts[row : row + 1], STEP, (7.5, 1.8))[0][0]
    twin = Twin(
        TwinSpec(
            "motor",
            spec.ModelSpec("function"),
            prediction=spec.PredictionSpec(horizon=1.0),
            signals={"i": spec.SignalSpec(hold=hold)} if hold is not None else {},
        ),
        model=model,
    )
    rows = {"t": STEP * np.arange(n), "i": i, "w": x + rng.normal(0, 0.002, n)}
    return [one.kind for one in twin.doctor(rows).findings]


@first_of("seed", range(3))
def test_a_measured_input_is_told_from_a_command(seed: int) -> None:
    assert "command" in told(seed, commanded=False)
    assert "command" not in told(seed, commanded=True)
    assert "command" not in told(seed, commanded=False, hold=False)
