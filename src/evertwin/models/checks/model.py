"""The laws of a Model, as a public checker.

>>> from evertwin.models.functions.function import FunctionModel
>>> from evertwin.signals import Layout
>>> decay = FunctionModel(lambda x, u, dt, p: ([x[0] + dt * u[0]],) * 2,
...     Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
>>> check_model(decay)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.errors import LawBroken
from evertwin.models.contract import BatchModel, KernelModel, LinearModel, Model, PartialModel
from evertwin.models.functions.function import kernel_of
from evertwin.models.kernels.kernel import ADOPT, ANEW, CONTINUE, Restart
from evertwin.models.kernels.rollout import roll
from evertwin.types import Float64, Inputs, Intervals, Outputs


def check_model(model: Model, u: Inputs | None = None, dt: Intervals | None = None) -> None:
    """Checks the laws of a model on the given rows (default: 12 seeded random rows).

    Laws: *shapes*; *purity* (arguments stay as they are, same call gives the same bits);
    *partition* (rows in one call or one by one give the same bits); *observe* (adopting the model's
    own outputs of a state keeps outputs; all NaN changes nothing); *kernel* (agrees bit for bit
    with ``simulate``); *batch* (so does each of its runs, restarts included); *linear* (``y0 +
    Phi·p`` agrees with ``simulate`` to 1e-9).

    Raises:
        LawBroken: names the law and the figures.
    """
    rng = np.random.default_rng(0)
    if u is None:
        u = model.inputs.from_stated(rng.uniform(-1, 1, (12, len(model.inputs))))
    if dt is None:
        dt = np.full(len(u), 0.05)
    p = model.parameters.values
    x = model.initial(p)
    if x.shape != (len(model.states),):
        raise LawBroken(f"shapes: initial gave {x.shape}, expected ({len(model.states)},)")
    kept = [a.copy() for a in (x, u, dt, p)]
    end, y = model.simulate(x, u, dt, p)
    if y.shape != (len(u), len(model.outputs)) or end.shape != x.shape:
        raise LawBroken(f"shapes: outputs {y.shape}, state {end.shape}")
    if any(not np.array_equal(a, b) for a, b in zip(kept, (x, u, dt, p), strict=True)):
        raise LawBroken("purity: simulate changed one of its arguments")
    _same("purity", (end, y), model.simulate(x, u, dt, p))
    state, rows = x, []
    for i in range(len(u)):
        state, row = model.simulate(state, u[i : i + 1], dt[i : i + 1], p)
        rows.append(row)
    _same("partition", (end, y), (state, np.concatenate(rows)))
    _same("observe: NaN", (end,), (model.observe(end, np.full(y.shape[1], np.nan)),))
    if isinstance(model, KernelModel):
        _same("kernel", (end, y), roll(model.kernel(), x, u, dt, p, Restart.never(*y.shape)))
    if isinstance(model, BatchModel):
        _batch(model, u, dt, y)
    if isinstance(model, LinearModel):
        _linear(model, u, dt, y)


def _same(law: str, a: tuple[Any, ...], b: tuple[Any, ...]) -> None:
    for left, right in zip(a, b, strict=True):
        if not np.array_equal(left, right, equal_nan=True):
            worst = np.nanmax(np.abs(left - right)) if left.shape == right.shape else np.inf
            raise LawBroken(f"{law}: results differ by {worst:.3g}, expected equal bits")


def _batch(model: BatchModel, u: Inputs, dt: Intervals, y: Outputs) -> None:
    p = model.parameters.values
    x = model.initial(p)
    kernel = kernel_of(model)
    code = np.zeros(len(u), dtype=np.uint8)
    code[len(u) // 4 :: 3] = ADOPT
    code[len(u) // 2 :: 5] = ANEW
    code[0] = CONTINUE
    restart = Restart(y, code, x)
    _, again = roll(kernel, x, u, dt, p, restart)
    both = np.stack([x, x]), np.stack([p, p])
    _same("batch", (y, y), tuple(model.simulate_batch(both[0], u, dt, both[1])))
    _same("batch", (again, again), tuple(model.simulate_batch(both[0], u, dt, both[1], restart)))


def _linear(model: LinearModel, u: Inputs, dt: Intervals, y: Outputs) -> None:
    p = model.parameters.values
    y0, phi = model.regressor(model.initial(p), u, dt, p)
    columns = model.columns
    if phi.shape != (len(u), *columns.shape):
        raise LawBroken(f"linear: Phi has shape {phi.shape}, expected {(len(u), *columns.shape)}")
    values = np.where(columns < 0, 0.0, p[columns])
    worst = np.max(np.abs(y0 + (phi * values).sum(axis=2) - y))
    if not worst <= 1e-9 * max(1.0, float(np.max(np.abs(y)))):
        raise LawBroken(f"linear: y0 + Phi·p differs from simulate by {worst:.3g}")
    if isinstance(model, PartialModel):
        _partial(model, u, dt, y0, phi)


def _partial(
    model: PartialModel, u: Inputs, dt: Intervals, y0: Outputs, phi: Float64[np.ndarray, "n ny m"]
) -> None:
    p, columns = model.parameters.values, model.columns
    chosen = columns % 2 == 0
    slot = np.where(chosen, np.cumsum(chosen, axis=1) - 1, -1)
    rest, some = model.partial(model.initial(p), u, dt, p, slot)
    stays = np.where(chosen | (columns < 0), 0.0, p[columns])
    expected = y0 + (phi * stays).sum(axis=2)
    worst = np.max(np.abs(rest - expected)) / max(1.0, float(np.max(np.abs(expected))))
    for k, j in np.argwhere(chosen).tolist():
        worst = max(worst, np.max(np.abs(some[:, k, slot[k, j]] - phi[:, k, j])))
    if not worst <= 1e-9:
        raise LawBroken(f"partial: differs from the regressor by {worst:.3g}")
