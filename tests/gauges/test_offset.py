"""Until when a sensor is off: a share of next to nothing says nothing of it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, TwinSpec
from evertwin.fold import Mark, Windows, make_block
from evertwin.gauges.changes.change import split
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.gauges.shifts.offset import offset
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import translated
from evertwin.setup.setup import Setup
from evertwin.signals import Layout
from evertwin.sources.spec import ChannelSpec, SourceSpec
from evertwin.sync.spec import DeriveSpec
from evertwin.tuning import Problem, solve
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of

ROWS, AT, LULL, DT = 2400, 1000, 1800, 0.05


def slid(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    speed = x[1] + dt * (u[0] - p[1] * x[1]) / p[0]
    return [x[0] + dt * speed, speed], [x[0] + dt * speed]


def told(seed: int) -> str:
    """A slide goes from place to place, and from LULL on stays about where it reads 0; from AT on
    its scale reads a fifth too much."""
    rng, x, v, goal, data = np.random.default_rng(seed), 0.0, 0.0, 2.0, np.empty((ROWS, 2))
    for k in range(ROWS):
        if k % 80 == 0:
            goal = rng.uniform(1.0, 3.0) * rng.choice([-1, 1]) * (0.03 if k >= LULL else 1.0)
        data[k] = np.clip(6.0 * (goal - x) - 5.0 * v, -8.0, 8.0), x
        v += DT * (data[k, 0] - v) / 1.5
        x += DT * v
    y = data[:, 1].copy()
    y[AT:] *= 1.2
    y += rng.normal(0.0, 0.004, ROWS)
    model = translated(FunctionModel(
        slid, Layout.of(force="N"), Layout.of(x="m"), Layout.of(x="m", v="m/s"),
        Parameters.of(mass=(1.5, "kg"), drag=(1.0, "Ns/m")),
    ))  # fmt: skip
    block = make_block(t=(np.arange(ROWS) * DT * 1e9).astype(int), u=data[:, :1], y=y[:, None])
    block.mark[AT, 1] = Mark.OVERRULED
    windows: Windows = (block,)

    def pose(windows: Windows) -> Problem:
        return Problem(model, windows, horizon=1.0)

    settings = AnomalySpec(0.08, relative=False)
    setup, since = Setup(TwinSpec("slide", ModelSpec("python"), anomaly=settings), model), AT
    new = pose(split(windows, since)[1])
    found = offset(Rows(setup, pose, windows, new, solve(new), solve, begins=since))
    return found.said if found else ""


@pytest.mark.parametrize("seed", range(3))
def test_a_scale_is_not_over_while_little_is_read(seed: int) -> None:
    said = told(seed)
    assert "a scale of its sensor" in said and f"from row {AT} on" in said


def heated(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    flow = p[0] * (x[1] - x[0])
    warm = x[0] + dt * (flow - 31.0 * (x[0] - 294.0)) / 5.2e4
    jacket = x[1] + dt * (u[0] - flow - p[1] * (x[1] - 294.0)) / 1.5e4
    return [warm, jacket], [warm, jacket]


def vessel(seed: int) -> str:
    """A vessel about 50 degC in a jacket, whose flow of heat is not quite that of the file; from
    800 on its temperature reads 1.5 K too much."""
    rng, power, data = np.random.default_rng(seed), 0.0, np.empty((1200, 3))
    x, true = [323.0, 326.0], np.array([415.0, 22.0])
    for k in range(len(data)):
        if k % 90 == 0:
            power = rng.uniform(0.5, 1.5) * 1600.0
        x = heated(x, np.array([power]), 1.0, true)[0]  # type: ignore[arg-type]
        data[k, 0], data[k, 1:] = power, x + rng.normal(0.0, 0.06, 2)
        data[k, 1] += 1.5 * (k >= 800)
    two = {"T": "K", "Tj": "K"}
    model = translated(FunctionModel(
        heated, Layout.of(power="W"), Layout.of(**two), Layout.of(**two),
        Parameters.of(UA=(385.0, "W/K"), Lj=(24.0, "W/K")),
    ))  # fmt: skip
    block = make_block(t=np.arange(1200) * 10**9, u=data[:, :1], y=data[:, 1:])
    block.mark[800, 1] = Mark.OVERRULED
    windows: Windows = (block,)

    def pose(windows: Windows) -> Problem:
        return Problem(model, windows, horizon=60.0)

    settings = AnomalySpec(0.15, relative=False)
    setup = Setup(TwinSpec("vessel", ModelSpec("python"), anomaly=settings), model)
    new = pose(split(windows, 800)[1])
    found = offset(Rows(setup, pose, windows, new, solve(new), solve, begins=800))
    return found.said if found else ""


@first_of("seed", range(5))
def test_an_offset_is_as_sure_as_the_numbers_beside_it(seed: int) -> None:
    """And where a share of what is read explains as much, both are said."""
    said = vessel(seed)
    size, half = (float(one) for one in re.findall(r"looks off by \+(\S+) ± (\S+) K", said)[0])
    assert abs(size - 1.5) <= 1.3 * half and half < 0.4
    assert "an offset or a scale of its sensor" in said and "cannot be told while T stays" in said


@pytest.mark.parametrize("derived", [False, True])
def test_what_is_derived_has_no_offset(derived: bool) -> None:
    """A force by place and speed; from AT on the speed reads 3 rad/s too much."""
    rng, t = np.random.default_rng(0), np.arange(ROWS) * DT
    q, qd = 0.1 * np.sin(0.8 * t), 0.08 * np.cos(0.8 * t)
    y = 2.0 * qd + q + rng.normal(0.0, 1e-3, ROWS)
    model = translated(FunctionModel(
        lambda x, u, dt, p: ([], [p[0] * u[1] + u[0]]), Layout.of(q="rad", qd="rad/s"),
        Layout.of(tau="Nm"), Layout(), Parameters.of(k=(2.0, "Nms/rad")),
    ))  # fmt: skip
    read = np.stack([q, qd + 3.0 * (np.arange(ROWS) >= AT)], axis=1)
    windows: Windows = (make_block(t=(t * 1e9).astype(int), u=read, y=y[:, None]),)

    def pose(windows: Windows) -> Problem:
        return Problem(model, windows)

    speed = (DeriveSpec(name="qd", op="derivative", source=("q",)),) if derived else ()
    log = SourceSpec("log", channels={"q": ChannelSpec("q", unit="rad")})
    spec = TwinSpec(
        "axis", ModelSpec("python"), source=(log,), anomaly=AnomalySpec(0.05), derive=speed
    )
    new = pose(split(windows, AT)[1])
    found = offset(Rows(Setup(spec, model), pose, windows, new, solve(new), solve, begins=AT))
    assert ("qd looks off by" in (found.said if found else "")) != derived
