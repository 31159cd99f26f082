"""A fit whose roll-outs run in processes: the same answer, bit for bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.errors import UsageError
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout

MODEL = """
from evertwin import FunctionModel, Layout, Parameters

def step(x, u, dt, p):
    level = x[0] + dt * (p[0] * u[0] - p[1] * x[0] - p[2] * x[0] * abs(x[0]))
    return [level], [level]

level = Layout.of(level="m")
model = FunctionModel(
    step, Layout.of(flow="m/s"), level, level,
    Parameters.of(gain=(1.0, "1"), leak=(0.2, "1/s"), outlet=(0.1, "1/(m*s)")),
)
"""
TWIN = """schema = 1
name = "tank"
[model]
kind = "python"
options = { file = "slow.py" }
[[source]]
name = "controller"
time = { column = "t", unit = "s" }
[source.channels]
flow = { column = "flow", unit = "m/s" }
level = { column = "level", unit = "m" }
[prediction]
horizon = "0.5 s"
"""


def recorded(rows: int) -> dict[str, Any]:
    rng, level = np.random.default_rng(4), [0.0]
    flow = np.repeat(rng.uniform(0.2, 1.5, rows // 10), 10)
    for u in flow[:-1]:
        x = level[-1]
        level.append(x + 0.1 * (1.3 * u - 0.3 * x - 0.15 * x * x))
    return {"t": 0.1 * np.arange(rows), "flow": flow, "level": level + rng.normal(0, 1e-3, rows)}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "slow.py").write_text(MODEL)
    (tmp_path / "tank.toml").write_text(TWIN)
    return tmp_path


def test_processes_give_the_same_fit(folder: Path) -> None:
    data = recorded(60)
    with Twin.open(folder / "tank.toml") as twin:
        here, there = twin.fit(data), twin.fit(data, workers=2)
    assert here.fit.converged and here.form == there.form
    assert np.array_equal(here.fit.values, there.fit.values)
    assert here.fit.evaluations == there.fit.evaluations


def test_a_model_that_no_file_names_is_refused() -> None:
    level = Layout.of(level="m")
    model = FunctionModel(
        lambda x, u, dt, p: ([p[0] * u[0]],) * 2, Layout.of(flow="m/s"), level, level,
        Parameters.of(gain=(1.0, "1")),
    )  # fmt: skip
    twin = Twin(TwinSpec("tank", spec.ModelSpec("python")), model)
    with twin, pytest.raises(UsageError, match="each process builds it anew"):
        twin.fit(recorded(20), workers=2)
