"""Many parameter vectors at once: the same bits, whichever way they run."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

from evertwin.machines.drive import Drive
from evertwin.machines.thermal import ThermalBox
from evertwin.models import FunctionModel, Model, Parameters, Restart, check_model, roll
from evertwin.models.batch import WORTH, Batch
from evertwin.models.corrected.corrected import Corrected, Term
from evertwin.models.kernels.kernel import ADOPT, ANEW
from evertwin.models.mujoco import MuJoCo
from evertwin.signals import Layout


def leak(x: Any, u: Any, dt: float, p: Any) -> Any:
    level = x[0] + dt * (u[0] - p[0] * x[0])
    return [level], [level]


def tank() -> FunctionModel:
    level = Layout.of(level="m")
    return FunctionModel(leak, Layout.of(q="m/s"), level, level, Parameters.of(k=(0.1, "1/s")))


def cart() -> MuJoCo:
    return MuJoCo.from_text(
        """<mujoco><option timestep="0.005" gravity="0 0 0"/><worldbody><body name="cart">
        <joint name="rail" type="slide" axis="1 0 0" damping="0.5" frictionloss="0.1"/>
        <geom size=".1" mass="2"/></body></worldbody>
        <actuator><motor name="force" joint="rail"/></actuator></mujoco>""",
        parameters=["body.cart.mass", "joint.rail.damping", "joint.rail.frictionloss"],
    )


DELAY = (Term("lag", "*", variant="delay"),)
WRAPPED = {
    "law": lambda: Corrected(cart(), (Term("law", "force", variant="dead zone"),)),
    "lag and law": lambda: Corrected(cart(), (Term("lag", "*"), Term("law", "force"))),
    "state": lambda: Corrected(cart(), (Term("state", "rail.pos"),)),
    "delayed": lambda: Corrected(cart(), DELAY),
    "corrected twice": lambda: Corrected(
        Corrected(cart(), (Term("law", "force"),)), (Term("lag", "force"),)
    ),
}


@pytest.mark.parametrize("name", WRAPPED)
def test_a_wrapper_runs_the_batch_of_its_model_with_the_bits_of_roll_outs(name: str) -> None:
    """Restarts, inputs that are not known, and vectors that share their inputs or do not."""
    model, rng, rows = WRAPPED[name](), np.random.default_rng(1), 40
    check_model(model)
    u, y = rng.normal(size=(rows, 1)), 0.1 * rng.normal(size=(rows, 2))
    u[[7, 20]] = np.nan
    code = np.zeros(rows, dtype=np.uint8)
    code[5::6], code[[0, 13, 22]] = ADOPT, ANEW
    p = np.tile(model.parameters.values, (5, 1))
    p[1:] *= rng.uniform(1.0, 1.2, (4, p.shape[1]))
    p[3] = p[2]
    starts, dt = np.stack([model.initial(one) for one in p]), np.full(rows, 0.01)
    runs = model.simulate_batch(starts, u, dt, p, Restart(y, code, starts[0]))
    for start, one, run in zip(starts, p, runs, strict=True):
        _, alone = roll(model.kernel(), start, u, dt, one, Restart(y, code, start))
        assert np.array_equal(run, alone, equal_nan=True)
    assert np.isfinite(runs).any() and np.isnan(runs[:, 7]).any()


@pytest.mark.long
def test_a_corrected_mujoco_model_gains_from_whole_stretches() -> None:
    """Row by row it would pay a Python call in each."""
    model = WRAPPED["law"]()
    u, dt = np.random.default_rng(2).normal(size=(3000, 1)), np.full(3000, 0.01)
    p = model.parameters.values[None]
    x, never = model.initial(p[0])[None], Restart.never(3000, 2)
    model.simulate_batch(x, u[:10], dt[:10], p)  # compiled once
    model.simulate(x[0], u[:10], dt[:10], p[0])
    began = time.process_time()
    whole = model.simulate_batch(x, u, dt, p, never)[0]
    middle = time.process_time()
    _, alone = model.simulate(x[0], u, dt, p[0])
    assert np.array_equal(whole, alone)
    assert time.process_time() - middle > 3.0 * (middle - began)


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
