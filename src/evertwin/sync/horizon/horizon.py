"""Predictions over one horizon, always from the measured state.

A twin that adopts measurements hides the quality of its model: whatever the model, its state is
pulled back. Models are therefore compared, tuned and watched on predictions over one fixed
horizon: start from measured outputs, simulate for the horizon, start again. `restarts` plans this
for rows in memory (`evertwin.models.roll` then gives the predictions); `Horizon` is the same as a
stage of the stream, with parameters in its state, so that a shadow is a second state.

Each output has its own clock, since sensors differ in rate: it is adopted again at its first
trusted sample once the horizon has passed (at once where a measurement overruled the simulation),
and predicted from the next row on. States that are not
measured run on. Where the data has a gap, opens a task, or an input is not known, the state starts
anew; a model without state never restarts.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> rows = make_block(t=np.arange(5) * 10**9, u=np.ones((5, 1)), y=np.arange(5.0)[:, None])
>>> restarts(rows, 2.0, np.zeros(1)).code.tolist()
[2, 0, 0, 1, 0]
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Block, Mark, Out
from evertwin.models import Kernel, Model, Restart, hidden_of, kernel_of
from evertwin.models.kernels.kernel import GAP, looped
from evertwin.signals import wrap
from evertwin.sync.horizon.horizon_loop import NEVER, began, plan, run
from evertwin.sync.horizon.horizon_state import HorizonRows, HorizonSettings, HorizonState
from evertwin.types import Bools, Inputs, Outputs, ParameterVector, StateVector


def nanoseconds(seconds: float) -> int:
    """A duration as a whole number of nanoseconds; infinity as the largest one.

    >>> nanoseconds(1.5)
    1500000000
    """
    return round(seconds * 1e9) if seconds < 9e9 else int(np.iinfo(np.int64).max)


def contiguous(block: Block) -> Block:
    """The block with arrays that compiled code can walk through by address; no copy if they are.

    >>> from evertwin.fold import make_block
    >>> rows = make_block(t=range(4), u=np.ones((4, 3)), y=np.ones((4, 1)))
    >>> contiguous(rows._replace(u=rows.u[:, 1:])).u.flags.c_contiguous
    True
    """
    return Block(block.row, *map(np.ascontiguousarray, block[1:]))


def trusted(block: Block) -> Outputs:
    """Measured outputs, NaN where they must not be adopted (only marks ok and overruled may be).

    >>> from evertwin.fold import make_block
    >>> trusted(make_block(t=[0], u=[[0.0]], y=[[2.0]])).tolist()
    [[2.0]]
    """
    mark = block.mark[:, block.u.shape[1] :]
    return np.where((mark == Mark.OK) | (mark == Mark.OVERRULED), block.y, np.nan)


def restarts(block: Block, horizon: float, x0: StateVector, keeps: bool = False) -> Restart:
    """Where predictions over ``horizon`` [s] start again, for `evertwin.models.roll`.

    The first row of the block starts anew. An infinite horizon is a free run per task.

    Args:
        block: rows of one or several tasks.
        horizon: length of a prediction [s]; ``inf`` for a free run.
        x0: state that a new start begins with, (nx,); empty for a static map: no restarts.
        keeps: does the state last through a gap (`evertwin.models.remembers`)?

    Raises:
        UsageError: the horizon is not above zero.
    """
    _check(horizon)
    code = np.zeros(len(block.t), dtype=np.uint8)
    y = trusted(block)
    if len(x0) == 0:
        return Restart(y, code, x0)
    adopts = np.full_like(y, np.nan)
    moved = block.mark[:, block.u.shape[1] :] == Mark.OVERRULED
    plan(block.t, openings(block), y, moved, nanoseconds(horizon), code, adopts)
    if keeps:
        same = np.append(False, block.task[1:] == block.task[:-1])
        code[block.gap & same & finite(block.u)] = GAP
    return Restart(adopts, code, x0)


def _check(horizon: float) -> None:
    if not horizon > 0:
        raise UsageError(f"horizon: expected a duration above 0 s, got {horizon}")


@dataclass(frozen=True)
class Horizon:
    """The stream of predictions over one horizon.

    >>> from evertwin.fold import make_block
    >>> from evertwin.models import FunctionModel
    >>> from evertwin.signals import Layout
    >>> robot = FunctionModel(lambda x, u, dt, p: ([x[0] + u[0] * dt],) * 2,
    ...     Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
    >>> rows = make_block(t=np.arange(5) * 10**9, u=np.ones((5, 1)), y=1.1 * np.arange(5)[:, None])
    >>> stage = Horizon(robot, 2.0)
    >>> state, out = stage.step(stage.init(), rows)
    >>> out.rows.residual.ravel().round(3).tolist(), out.rows.end.tolist()
    ([nan, 0.1, 0.2, 0.1, 0.2], [False, False, True, False, True])
    >>> out.rows.losses.round(3).tolist()
    [0.025, 0.025]
    """

    model: Model
    horizon: float = 1.0
    """Length of a prediction [s]."""
    scale: tuple[float, ...] = field(default=())
    """One unit of loss per output, in its unit; ones by default."""

    def __post_init__(self) -> None:
        _check(self.horizon)
        ny = len(self.model.outputs)
        if self.scale and (len(self.scale) != ny or not all(0 < s < math.inf for s in self.scale)):
            raise UsageError(f"scale: expected {ny} numbers above 0, got {self.scale}")

    @cached_property
    def _kernel(self) -> Kernel:
        return kernel_of(self.model)

    @cached_property
    def _fixed(self) -> HorizonSettings:
        return HorizonSettings(self.model.outputs.angles, nanoseconds(self.horizon), self.settles)

    @property
    def settles(self) -> int:
        """Segments in the first horizon after a new start, which is no measure of the model: by
        them its states that nothing measures are estimated."""
        hidden = len(hidden_of(self.model))
        return hidden and hidden + 1

    def init(self) -> HorizonState:
        """The state before the first row, with the model's own parameters."""
        p = self.model.parameters.values
        x0, ny = self.model.initial(p), len(self.model.outputs)
        scale = np.array(self.scale or (1.0,) * ny, dtype=np.float64)
        adopted, clock = np.full(ny, NEVER), np.zeros(6, dtype=np.int64)
        zeros = np.zeros(ny), np.zeros(ny, dtype=np.int64)
        return HorizonState(x0.copy(), p, x0, scale, *zeros, adopted, clock)

    def renew(self, state: HorizonState, p: ParameterVector) -> HorizonState:
        """The state with other parameters; the model's state runs on. Consumes ``state``."""
        values = np.array(p, dtype=np.float64)
        return state._replace(p=values, x0=self.model.initial(values))

    def step(self, state: HorizonState, block: Block) -> tuple[HorizonState, Out]:
        return self._run(state, block, np.empty(block.y.shape), given=False)

    def judge(self, state: HorizonState, block: Block, y: Outputs) -> tuple[HorizonState, Out]:
        """As `step`, where the block's predictions ``y`` are known already. Consumes ``state``.

        Only a model without state predicts the same in every stage.

        Raises:
            UsageError: the model has states.
        """
        if len(state.x):
            raise UsageError(
                "judge: a model with states predicts from a state of its own: use step"
            )
        return self._run(state, block, np.ascontiguousarray(y), given=True)

    def _run(
        self, state: HorizonState, block: Block, y: Outputs, *, given: bool
    ) -> tuple[HorizonState, Out]:
        n, ny = y.shape
        rows = HorizonRows(
            y, np.empty((n, ny)), np.zeros(n, dtype=np.bool_), np.zeros((n, ny)),
            np.zeros((n, ny), dtype=np.int64),
        )  # fmt: skip
        looped(run, self._kernel, given, contiguous(block), self._fixed, state, rows)
        return state, Out(rows)


def residuals(model: Model, block: Block, y: Outputs) -> Outputs:
    """Measured − predicted for predictions ``y`` of the block's rows, angles wrapped, (n, ny).

    NaN where not measured, not trusted (worse than held; what overruled the simulation is adopted,
    but no measure of the model), not predicted, or not started: a sensor that reports later than
    the row where the state starts anew is compared from its second sample on, the first being
    adopted.
    """
    mark = block.mark[:, block.u.shape[1] :]
    known = mark <= Mark.HELD
    if len(model.states):
        known &= began(openings(block), ~np.isnan(trusted(block)))
    return wrap(np.where(known, block.y - y, np.nan), model.outputs.angles)


def finite(u: Inputs) -> Bools:
    """True at rows whose inputs are all numbers, (n,).

    >>> finite(np.array([[1.0, 2.0], [3.0, np.nan]])).tolist()
    [True, False]
    """
    known = np.isfinite(u)
    # row by row only where it has to be: that costs more than all numbers at once
    return np.ones(len(u), dtype=np.bool_) if known.all() else known.all(axis=1)


def openings(block: Block) -> Bools:
    """True at rows where the state starts anew, the block's first row included, (n,)."""
    anew: Bools = block.gap | ~finite(block.u)
    anew[1:] |= block.task[1:] != block.task[:-1]
    anew[0] = True
    return anew
