"""Until when a sensor is off: a share of next to nothing says nothing of it."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, TwinSpec
from evertwin.fold import Mark, make_block
from evertwin.gauges.change import split
from evertwin.gauges.gauge_rows import Rows
from evertwin.gauges.offset import offset
from evertwin.models import FunctionModel, Parameters
from evertwin.models.translated import translated
from evertwin.setup.setup import Setup
from evertwin.setup.task import Windows
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve
from evertwin.types import ParameterVector, Vector

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
