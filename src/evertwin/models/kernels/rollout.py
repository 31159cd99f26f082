"""Rows simulated by a kernel, in one compiled loop.

A kernel reads memory and cannot complain, so sizes are checked before:

>>> import numpy as np
>>> sized(np.zeros(1), Layout.of(x="m"), np.zeros(0), Parameters())
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit
from evertwin.compiled.memory import copied
from evertwin.errors import UsageError
from evertwin.models.kernels.kernel import ADOPT, ANEW, Kernel, Restart, looped
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout
from evertwin.types import Inputs, Intervals, ParameterVector, Rollout, StateVector


@njit(cache=True)
def roll_rows(
    step: int, observe: int, context: Any, rows: tuple[Any, ...], x: Any, p: Any, out: Any
) -> None:
    """One pass over the rows (inputs, steps, `Restart`): restart (where asked), step, store."""
    u, dt, (y, code, x0) = rows
    n, nu, ny = u.shape[0], u.shape[1], out.shape[1]
    ahead = np.empty_like(x)
    u_at, out_at, y_at = u.ctypes.data, out.ctypes.data, y.ctypes.data
    c, a, b, parameters = context.ctypes.data, x.ctypes.data, ahead.ctypes.data, p.ctypes.data
    for i in range(n):
        if code[i] >= ANEW:
            out[i, :] = np.nan
            if code[i] == ANEW:
                copied(x, x0)
            else:
                call(observe, c, a, out_at + 8 * i * ny)  # nothing: what was expected is void
            call(observe, c, a, y_at + 8 * i * ny)
            continue
        if code[i] == ADOPT:
            call(observe, c, a, y_at + 8 * (i - 1) * ny)
        failed = call(step, c, a, u_at + 8 * i * nu, dt[i], parameters, b, out_at + 8 * i * ny)
        if failed != 0:
            out[i, :] = np.nan
        copied(x, ahead)


def roll(
    kernel: Kernel, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector, restart: Restart
) -> Rollout:
    """Rows simulated by a kernel: (state after the last, outputs (n, ny)).

    A row whose step failed is NaN, and so is a row that starts anew.
    """
    state = np.array(x, dtype=np.float64)
    out = np.empty((len(u), restart.y.shape[1]))
    rows = contiguous(u, dt, restart._replace(x0=np.array(restart.x0, dtype=np.float64)))
    looped(roll_rows, kernel, rows, state, np.ascontiguousarray(p), out)
    return state, out


def contiguous(u: Inputs, dt: Intervals, restart: Restart) -> tuple[Inputs, Intervals, Restart]:
    """Rows as `roll_rows` reads them."""
    y = np.ascontiguousarray(restart.y)
    return np.ascontiguousarray(u), np.ascontiguousarray(dt), restart._replace(y=y)


def sized(x: StateVector, states: Layout, p: ParameterVector, parameters: Parameters) -> None:
    """Do state and parameters have the model's sizes?

    Raises:
        UsageError: they have not.
    """
    if x.shape != (len(states),) or p.shape != (len(parameters),):
        raise UsageError(
            f"expected a state of {len(states)} and {len(parameters)} parameters, got "
            f"{x.shape} and {p.shape}: start from model.initial(p)"
        )
