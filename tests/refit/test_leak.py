"""What a state loses by itself and the model leaves out, in a tank that nothing measures or in one
that is measured; a form that holds gets no such term."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.refit import FitResult
from planted.draws import first_of

MODEL = """
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout

def step(x, u, dt, p):
    upper, level = x
    out = p[0] * max(upper, 0.0) ** 0.5
    upper = max(upper + dt * (p[2] * u[0] - out), 0.0)
    level = max(level + dt * (out - p[1] * max(level, 0.0) ** 0.5), 0.0)
    return [upper, level], [level]

model = FunctionModel(
    step, Layout.of(pump="V"), Layout.of(level="V"), Layout.of(upper="V", level="V"),
    Parameters.of(k1=(0.06, "V^0.5/s"), k2=(0.05, "V^0.5/s"), k3=(0.05, "1/s")),
)
"""
TWIN = """
schema = 1
name = "tanks"
[model]
kind = "python"
options = { file = "tanks.py", name = "model" }
[correction]
channels = ["upper", "level"]
terms = ["leak"]
in_fit = true
horizon = "200 s"
"""


def recording(rng: np.random.Generator, k: np.ndarray, leak: tuple[float, float]) -> dict:
    """1,000 rows, 4 s apart; ``leak``: shares that the upper and the lower tank lose [1/s]."""
    u, (a, b), level = np.repeat(rng.uniform(1, 4, 50), 20), rng.uniform(3, 6, 2), []
    for pump in u:
        level.append(b)
        for _ in range(4):
            out = k[0] * max(a, 0.0) ** 0.5
            b = max(b + out - k[1] * max(b, 0.0) ** 0.5 - leak[1] * b, 0.0)
            a = max(a + k[2] * pump - out - leak[0] * a, 0.0)
    return {"t": 4.0 * np.arange(1000), "pump": u, "level": level + 0.02 * rng.normal(size=1000)}


def fitted(folder: Path, seed: int, leak: tuple[float, float]) -> FitResult:
    (folder / "tanks.py").write_text(MODEL)
    (folder / "tanks.toml").write_text(TWIN)
    rng = np.random.default_rng(seed)
    k = np.array([0.06, 0.05, 0.05]) * np.exp(0.1 * rng.normal(size=3))
    train, test = recording(rng, k, leak), recording(rng, k, leak)
    return Twin.open(folder / "tanks.toml").fit(train, test=[test])


@first_of("seed", range(3))
@pytest.mark.parametrize("leak", [(0.005, 0.0), pytest.param((0.0, 0.005), marks=pytest.mark.long)])
def test_a_leak_is_found(tmp_path: Path, seed: int, leak: tuple[float, float]) -> None:
    found = fitted(tmp_path, seed, leak)
    assert [term.kind for term in found.form.terms] == ["leak"], str(found)
    assert found.test[0].rms < 0.04, str(found)  # the noise is 0.02, the rows are 4 s apart


@first_of("seed", range(3))
def test_none_is_found_where_none_is(tmp_path: Path, seed: int) -> None:
    assert not fitted(tmp_path, seed, (0.0, 0.0)).form.terms
