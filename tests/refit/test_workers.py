"""A fit whose roll-outs run in processes: the same answer, bit for bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.errors import ConfigError, UsageError, WorkLost
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
        again = twin.fit(data, workers=2)
    assert here.fit.converged and here.form == there.form
    for one in (there, again):
        assert np.array_equal(here.fit.values, one.fit.values)
        assert here.fit.evaluations == one.fit.evaluations


def test_processes_stay_warm_until_the_twin_is_closed(folder: Path) -> None:
    with Twin.open(folder / "tank.toml") as twin:
        twin.fit(recorded(20), workers=1)
        first = twin._engines.of(1)
        twin.fit(recorded(20), workers=1)
        assert twin._engines.of(1) is first
        twin.fit(recorded(20), workers=0)
        assert first.map(abs, [-1]) == [1], "who has it may go on"
    with pytest.raises(UsageError, match="the pool is closed"):
        first.map(abs, [1])


def test_a_fit_beyond_its_limits_ends_in_words(folder: Path) -> None:
    file = folder / "tank.toml"
    file.write_text(f'{TWIN}[engine]\nworkers = 1\ntime = "1 ms"\n')
    with Twin.open(file) as twin, pytest.raises(WorkLost, match=r"longer than 0\.001 s"):
        twin.fit(recorded(60))


@pytest.mark.parametrize("said", ["workers = -1", "workers = 65", 'time = "0 s"', "memory = 0.01"])
def test_limits_are_bounded(folder: Path, said: str) -> None:
    file = folder / "tank.toml"
    file.write_text(f"{TWIN}[engine]\n{said}\n")
    with pytest.raises(ConfigError, match=said.split()[0]):
        Twin.open(file)


def test_so_many_processes_are_refused(folder: Path) -> None:
    with Twin.open(folder / "tank.toml") as twin, pytest.raises(UsageError, match="workers"):
        twin.fit(recorded(20), workers=1000)


def test_a_model_that_no_file_names_is_refused() -> None:
    level = Layout.of(level="m")
    model = FunctionModel(
        lambda x, u, dt, p: ([p[0] * u[0]],) * 2, Layout.of(flow="m/s"), level, level,
        Parameters.of(gain=(1.0, "1")),
    )  # fmt: skip
    twin = Twin(TwinSpec("tank", spec.ModelSpec("python")), model)
    with twin, pytest.raises(UsageError, match="each process builds it anew"):
        twin.fit(recorded(20), workers=2)
