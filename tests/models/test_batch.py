"""Many parameter vectors at once: the same bits, whichever way they run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.machines.drive import Drive
from evertwin.machines.thermal import ThermalBox
from evertwin.models import FunctionModel, Model, Parameters, Restart, roll
from evertwin.models.batch import WORTH, Batch
from evertwin.models.corrected import Corrected, Term
from evertwin.models.kernel import ADOPT, ANEW
from evertwin.signals import Layout


def leak(x: Any, u: Any, dt: float, p: Any) -> Any:
    level = x[0] + dt * (u[0] - p[0] * x[0])
    return [level], [level]


def tank() -> FunctionModel:
    level = Layout.of(level="m")
    return FunctionModel(leak, Layout.of(q="m/s"), level, level, Parameters.of(k=(0.1, "1/s")))


@pytest.mark.parametrize(
    "model",
    [
        Drive("tanh"),
        ThermalBox(),
        tank(),
        Corrected(Drive("tanh"), (Term("lag", "*"),)),
        Corrected(tank(), (Term("law", "q"),)),
    ],
    ids=["drive", "box", "function", "corrected", "corrected function"],
)
@pytest.mark.parametrize("rows", [12, WORTH // 4])
def test_each_run_has_the_bits_of_a_roll_out(model: Model, rows: int) -> None:
    rng = np.random.default_rng(0)
    u = rng.uniform(0.1, 1.0, (rows, len(model.inputs)))
    y = rng.uniform(0.0, 1.0, (rows, len(model.outputs)))
    code = np.zeros(rows, dtype=np.uint8)
    code[3::7], code[5::11] = ADOPT, ANEW
    p = np.tile(model.parameters.values, (4, 1)) * rng.uniform(1.0, 1.1, (4, 1))
    dt, restart = np.full(rows, 0.01), Restart(y, code, np.full(len(model.states), 99.0))
    batch = Batch(model, workers=2)
    runs = batch.run(u, dt, p, restart)
    assert np.array_equal(runs, batch.run(u, dt, p, restart), equal_nan=True)
    for one, run in zip(p, runs, strict=True):
        start = model.initial(one)
        _, alone = roll(batch.kernel, start, u, dt, one, restart._replace(x0=start))
        assert np.array_equal(run, alone, equal_nan=True)
        assert np.isfinite(run).any()
