"""A force's and a mass's scale act alike in a machine with states: one is told, with the other."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters
from evertwin.fold import make_block
from evertwin.gauges.rows.settled import settled
from evertwin.models.functions.translated import translated
from evertwin.tuning import Problem
from evertwin.types import ParameterVector, Vector


def driven(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    speed = x[0] + dt * (p[0] * u[0] - p[2] * x[0]) / p[1]
    return [speed], [speed]


@pytest.mark.parametrize("seed", range(5))
def test_of_a_scale_one_number_is_told_with_the_others(seed: int) -> None:
    rng, speed = np.random.default_rng(seed), 0.0
    force, y = np.repeat(rng.uniform(-5.0, 5.0, 40), 20), np.empty(800)
    for k in range(800):
        speed += 0.05 * (0.8 * force[k] - 0.5 * speed) / 2.0
        y[k] = speed
    model = translated(FunctionModel(
        driven, Layout.of(force="N"), Layout.of(speed="m/s"), Layout.of(speed="m/s"),
        Parameters.of(gain=(1.0, "1"), mass=(2.0, "kg"), rubs=(0.4, "kg/s")),
    ))  # fmt: skip
    rows = make_block(
        t=np.arange(800) * 50_000_000, u=force[:, None],
        y=(y + rng.normal(0.0, 0.01, 800))[:, None],
    )  # fmt: skip
    fit = settled(Problem(model, (rows,), horizon=2.0))
    assert sorted(fit.verdict) == ["not", "weak", "weak"]
    assert sum("only both together are told" in reason for reason in fit.reasons) == 2
    assert np.count_nonzero(fit.values == fit.start) == 1
    assert abs(fit["gain"] / fit["mass"] - 0.4) < 0.01
    assert abs(fit["rubs"] / fit["mass"] - 0.25) < 0.02
