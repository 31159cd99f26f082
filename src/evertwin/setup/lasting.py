"""States that nothing measures, whose start the model gives as a number, and that never forget it.

Such a number is of where a recording begins. In a window that is cut from the middle of one the
state is anywhere, and what it is off by would be taken for the machine or for a sensor.
"""

from __future__ import annotations

import numpy as np

from evertwin.errors import DataError
from evertwin.fold import Block
from evertwin.models import KernelModel, Model, Restart
from evertwin.models.corrected import Corrected
from evertwin.models.function import kernel_of
from evertwin.models.rollout import roll
from evertwin.rows.ring import called
from evertwin.setup.task import Windows
from evertwin.sync.horizon import restarts
from evertwin.tuning.recordings import initials
from evertwin.types import Outputs, ParameterVector, StateVector

LITTLE = 1e-3
"""Share of its size, or of 1, that a state is moved by."""
LASTS = 0.5
"""Share of what that does to the outputs at first that is still there at the end."""
PARTS = 10
"""Parts of the rows: the first and the last are compared."""


def lasting(model: Model, p: ParameterVector, block: Block, horizon: float) -> tuple[str, ...]:
    """Names of these states; none of a model that cannot be run from any state.

    >>> from evertwin.fold import make_block
    >>> from evertwin.models import FunctionModel, Parameters
    >>> from evertwin.signals import Layout
    >>> cell = FunctionModel(lambda x, u, dt, p: ([x[0] - dt * u[0]], [x[0] - p[0] * u[0]]),
    ...     Layout.of(current="A"), Layout.of(voltage="V"), Layout.of(charge="1"),
    ...     Parameters.of(resistance=(0.1, "Ohm")), start=(0.9,))
    >>> rows = make_block(t=np.arange(50) * 10**9, u=np.ones((50, 1)), y=np.ones((50, 1)))
    >>> lasting(cell, cell.parameters.values, rows, 10.0)
    ('charge',)
    """
    if not isinstance(model, KernelModel) or not len(model.states):
        return ()
    x0 = model.initial(p)
    plan = restarts(block, horizon, x0)
    usual = _predicted(model, p, block, plan, x0)
    found, size = [], max(len(block.t) // PARTS, 2)
    own = model.model if isinstance(model, Corrected) else model  # a term's memory is short
    for k, name in enumerate(own.states.names):
        moved = x0.copy()
        moved[k] += LITTLE * max(abs(moved[k]), 1.0)
        if name in model.outputs.names or _told(model, p, k):
            continue
        off = np.abs(_predicted(model, p, block, plan, moved) - usual)
        first, last = (np.nanmax(part, axis=0, initial=0.0) for part in (off[:size], off[-size:]))
        if ((last > LASTS * first) & (last > 0.0)).any():
            found.append(name)
    return tuple(found)


def begun(windows: Windows, model: Model, p: ParameterVector, horizon: float) -> Windows:
    """The windows without the first, if that is cut from a recording and a state lasts.

    Raises:
        DataError: there is no other.
    """
    if not windows or windows[0].row == 0 or not (names := lasting(model, p, windows[0], horizon)):
        return windows
    if windows[1:]:
        return windows[1:]
    raise DataError(
        f"what {' and '.join(names)} was at {called(windows[0].row)} is not known: nothing "
        "measures it, the model gives its start as a number, and it does not forget it; give the "
        'start as a parameter (start = ("name", …)), which is fitted where rows begin'
    )


def _told(model: Model, p: ParameterVector, k: int) -> bool:
    """Is the start of state ``k`` a parameter?"""
    other = p.copy()
    for name in initials(model):
        other[model.parameters.index(name)] += 1.0
    return bool(model.initial(other)[k] != model.initial(p)[k])


def _predicted(
    model: KernelModel, p: ParameterVector, block: Block, plan: Restart, x0: StateVector
) -> Outputs:
    return roll(kernel_of(model), x0, block.u, block.dt, p, plan._replace(x0=x0))[1]
