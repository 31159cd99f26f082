"""Where a machine was last: the state of its model after recorded rows.

>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> model, u, y = Robot1D(), [[0.0], [0.1], [0.1]], [[1.0], [1.1], [1.2]]
>>> rows = make_block(t=np.arange(3) * 10**9, u=u, y=y)
>>> state_after(model, model.parameters.values, rows).tolist()
[1.2]
"""

from __future__ import annotations

import numpy as np

from evertwin.fold import Block
from evertwin.models import Model, Restart, observed, roll
from evertwin.models.functions.function import kernel_of
from evertwin.models.kernels.kernel import ANEW
from evertwin.sync.horizon.horizon import openings, trusted
from evertwin.types import ParameterVector, StateVector


def state_after(model: Model, p: ParameterVector, rows: Block) -> StateVector:
    """The state after recorded rows, each trusted measurement adopted as it came, (nx,); that of
    the last row too, which no later one adopts."""
    if not len(model.states):
        return model.initial(p)
    y = trusted(rows)
    seen = observed(model, np.isfinite(y).any(axis=0))
    code = np.isfinite(y).any(axis=1).astype(np.uint8)
    code[openings(rows)] = ANEW
    x0 = seen.initial(p)
    x, _ = roll(kernel_of(seen), x0, rows.u, rows.dt, p, Restart(y, code, x0))
    return model.observe(x[: len(model.states)], y[-1])
