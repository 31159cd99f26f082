"""A Python function as a model: ten lines that run, are tuned and promoted; mistakes are told."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin
from evertwin.errors import ConfigError, ModelError
from evertwin.fold import make_block
from evertwin.machines.catalog import machine
from evertwin.models import FunctionModel, Parameters, Restart, roll
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve
from planted.draws import first_of

TEN = """from evertwin import FunctionModel, Layout, Parameters

def step(x, u, dt, p):
    level = x[0] + dt * (u[0] - p[0] * x[0])
    return [level], [level]

model = FunctionModel(
    step, Layout.of(inflow="m/s"), Layout.of(level="m"), Layout.of(level="m"),
    Parameters.of(leak=(0.1, "1/s")))
"""
TWIN = """schema = 1
name = "tank"
beat = 20

[model]
kind = "python"
options = { file = "tank.py" }

[[source]]
name = "log"
files = ["tank.csv"]
time = { column = "t", unit = "s" }
channels.inflow = { column = "inflow", unit = "m/s" }
channels.level = { column = "level", unit = "m" }

[prediction]
horizon = "5 s"

[anomaly]
requirement = "2 cm"
window = 200
"""


def test_ten_lines_run_are_tuned_and_promoted(tmp_path: Path) -> None:
    assert len([line for line in TEN.splitlines() if line]) < 10
    (tmp_path / "tank.py").write_text(TEN)
    (tmp_path / "tank.toml").write_text(TWIN)
    rng = np.random.default_rng(0)
    inflow = np.repeat(rng.uniform(0.0, 0.2, 60), 40)
    level = np.zeros(2400)
    for k in range(2399):
        level[k + 1] = level[k] + 0.1 * (inflow[k] - 0.16 * level[k])
    level += rng.normal(0, 0.002, 2400)
    rows = np.column_stack([0.1 * np.arange(2400), inflow, level])
    np.savetxt(tmp_path / "tank.csv", rows, delimiter=",", header="t,inflow,level", comments="")
    with Twin.open(tmp_path / "tank.toml") as twin:
        result = twin.run()
        champion = twin.parameters_of(twin.champion.number)
    assert result.of_kind("promoted")
    assert champion["leak"].value == pytest.approx(0.16, abs=0.005)


@first_of("seed", range(3))
@pytest.mark.parametrize("named", ["", '[tuning]\neditable = ["*"]\n'])
def test_a_number_whose_bounds_are_alike_is_fixed(tmp_path: Path, seed: int, named: str) -> None:
    items = '(Parameter("leak", 0.1, "1/s", 0.0, 1.0), Parameter("gain", 1.0, "1", 1.0, 1.0))'
    text = TEN.replace("Layout, Parameters", "Layout, Parameter, Parameters")
    text = text.replace('Parameters.of(leak=(0.1, "1/s"))', f"Parameters({items})")
    (tmp_path / "tank.py").write_text(text.replace("(u[0] -", "(p[1] * u[0] -"))
    (tmp_path / "tank.toml").write_text(TWIN + named)
    rng = np.random.default_rng(seed)
    inflow = np.repeat(rng.uniform(0.0, 0.2, 30), 40)
    level = np.zeros(1200)
    for k in range(1199):
        level[k + 1] = level[k] + 0.1 * (inflow[k] - 0.16 * level[k])
    level += rng.normal(0, 0.002, 1200)
    rows = {"t": 0.1 * np.arange(1200), "inflow": inflow, "level": level}
    with Twin.open(tmp_path / "tank.toml") as twin:
        found = twin.fit(rows).parameters
        assert not twin.doctor(rows).findings
    assert found["leak"].value == pytest.approx(0.16, abs=0.005)
    assert found["gain"].value == 1.0


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("level = levle", r"tank\.py:2: NameError: name 'levle'"),
        ("level = u[3]", r"tank\.py:2: IndexError"),
        ("level = x + 'a'", r"tank\.py:2: .*Error"),
        (
            "return [0.0, 0.0], [0.0]",
            r"tank\.py: ModelError: step: expected 1 states and 1 outputs",
        ),
    ],
)
def test_a_mistake_is_told_with_its_line_before_anything_runs(
    tmp_path: Path, line: str, told: str
) -> None:
    text = (
        f"def step(x, u, dt, p):\n    {line}\n    return [level], [level]\n"
        "from evertwin import FunctionModel, Layout\n"
        "model = FunctionModel(step, Layout.of(u='1'), Layout.of(y='1'), Layout.of(y='1'))\n"
    )
    (tmp_path / "tank.py").write_text(text)
    with pytest.raises(ModelError, match=told):
        machine("python", {"file": str(tmp_path / "tank.py")})


@pytest.mark.parametrize(
    ("start", "told"),
    [("('v0',)", "one entry for each state .x, v.*got 1"), ("(0.0, 'v1')", "no parameter.*'v1'")],
)
def test_a_start_has_an_entry_for_each_state(tmp_path: Path, start: str, told: str) -> None:
    text = (
        "from evertwin import FunctionModel, Layout, Parameters\n"
        "def step(x, u, dt, p):\n    return [x[0] + dt * x[1], x[1] + dt * u[0]], [x[0]]\n"
        "model = FunctionModel(step, Layout.of(u='1'), Layout.of(x='1'), Layout.of(x='1', v='1'),\n"
        f"    Parameters.of(v0=(0.0, '1')), start={start})\n"
    )
    (tmp_path / "cart.py").write_text(text)
    with pytest.raises(ConfigError, match=told):
        machine("python", {"file": str(tmp_path / "cart.py")})


@pytest.mark.filterwarnings("error")
def test_a_row_of_zeros_may_be_none_of_the_machines(tmp_path: Path) -> None:
    text = TEN.replace("u[0] - p[0] * x[0]", "u[0] - p[0] * x[0] / u[0]")
    (tmp_path / "tank.py").write_text(text)
    machine("python", {"file": str(tmp_path / "tank.py")})


def test_an_error_in_one_row_loses_that_row_and_is_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def step(x, u, dt, p):  # type: ignore[no-untyped-def]
        if u[0] > 1.0:
            raise RuntimeError("too much")
        return [], [u[0]]

    model = FunctionModel(step, Layout.of(u="1"), Layout.of(y="1"))
    u = np.array([[0.5], [2.0], [0.7], [3.0]])
    with caplog.at_level(logging.WARNING, "evertwin"):
        _, y = roll(model.kernel(), np.zeros(0), u, np.ones(4), np.zeros(0), Restart.never(4, 1))
    assert np.isnan(y.ravel()).tolist() == [False, True, False, True]
    (record,) = caplog.records
    assert "test_python_function.py" in record.getMessage()
    assert "RuntimeError: too much" in record.getMessage()


def test_a_state_that_nothing_measures_begins_at_a_parameter() -> None:
    """Two tanks: the level above is not measured; each recording has its own."""

    def step(x: Any, u: Any, dt: float, p: Any) -> tuple[list[float], list[float]]:
        upper, lower = x
        through = p[0] * upper * dt
        return [upper + u[0] * dt - through, lower + through], [lower]

    start = ("above", 0.0)
    layouts = Layout.of(flow="m/s"), Layout.of(level="m"), Layout.of(upper="m", lower="m")
    parameters = Parameters.of(rate=(0.2, "1/s"), above=(1.0, "m"))
    model = FunctionModel(step, *layouts, parameters, start)
    assert model.initials == ("above",)
    t, u = np.arange(60) * 10**9, np.full((60, 1), 0.1)
    dt = np.r_[0.0, np.ones(59)]
    _, y = model.simulate(np.array([3.0, 0.0]), u, dt, np.array([0.3, 0.0]))
    fit = solve(Problem(model, (make_block(t=t, u=u, y=y),), horizon=1e3))
    assert (fit["rate"], fit["above"]) == pytest.approx((0.3, 3.0), rel=0.05)
