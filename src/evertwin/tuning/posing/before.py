"""What a machine had come to where rows are cut from the middle of a recording.

A state that nothing measures is anywhere there, and from the start of a recording a fit would take
what it is off by for the machine. It is where a simulation of the rows before has come to.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from evertwin.fold import Block, concatenate, take
from evertwin.models import Model, observed, remembers
from evertwin.models.functions.function import kernel_of
from evertwin.models.kernels.rollout import roll
from evertwin.sync.horizon.horizon import restarts
from evertwin.tuning.posing.recordings import given
from evertwin.types import Outputs, ParameterVector, StateVector

LITTLE = 0.02
"""Share of the spread of an output that does not tell a state any more."""
Begins: TypeAlias = dict[int, StateVector]
"""Number of a window's first row → state that the rows before it came to."""


def leading(before: Sequence[Block], window: Block) -> Block | None:
    """The rows of a window's recording up to its first one; None: it is the first that is known.

    >>> from evertwin.fold import make_block
    >>> rows = make_block(t=range(4), u=np.zeros((4, 1)), y=np.zeros((4, 1)))
    >>> found = leading([rows], take(rows, 2, 4))
    >>> found and len(found.t), leading([rows], rows)
    (3, None)
    """
    parts, task = [take(window, 0, 1)], window.task[0]
    for block in reversed(before):
        stop = min(parts[0].row - block.row, len(block.t))
        if stop <= 0:
            continue
        if block.row + stop != parts[0].row or block.task[0] != task or parts[0].gap[0]:
            break
        parts.insert(0, take(block, 0, stop))
    if not parts[1:]:
        return None
    found = concatenate(parts)
    return found._replace(dt=np.append(found.dt[:1], np.diff(found.t) * 1e-9))


def begins(
    model: Model, p: ParameterVector, horizon: float, rows: tuple[Sequence[Block], Sequence[Block]]
) -> Begins:
    """States that windows begin with; of those that nothing tells anything of, none.

    Args:
        model: with parameters ``p`` (np,), of which recordings' own starts count no more.
        p: as the version is.
        horizon: of its predictions [s].
        rows: those that are known, in order, and the windows.
    """
    before, windows = rows
    found = Begins()
    if not len(model.states):
        return found
    for window in windows:
        lead = leading(before, window)
        if lead is not None:
            seen = observed(model, np.isfinite(lead.y).any(axis=0))
            x0 = seen.initial(p)
            x = roll(
                kernel_of(seen),
                x0,
                lead.u,
                lead.dt,
                p,
                restarts(lead, horizon, x0, remembers(seen)),
            )[0]
            x = x[: len(model.states)]
            if np.isfinite(x).all():
                found[window.row] = x
    return found


def later(
    model: Model, p: ParameterVector, horizon: float, rows: tuple[Sequence[Block], Sequence[Block]]
) -> tuple[Block, ...]:
    """The windows; the first without the rows by which a simulation comes to what it begins with,
    where too few are known from before. ``rows`` as in `begins`."""
    before, windows = rows
    first, half = windows[0], len(windows[0].t) // 2
    if not (len(model.states) and half) or first.dt[0] <= 0.0 or first.gap[0]:
        return tuple(windows)
    lead = leading(before, first)
    rest = settles(model, p, horizon, first) - (0 if lead is None else len(lead.t) - 1)
    cut = min(max(rest, 0), half)
    return (take(first, cut, len(first.t)), *windows[1:])


def settles(model: Model, p: ParameterVector, horizon: float, window: Block) -> int:
    """Rows after which predictions no more tell which state the window began with."""
    kernel, x0, half = kernel_of(model), model.initial(p), len(window.t) // 2

    def run(x: StateVector, rows: Block) -> tuple[StateVector, Outputs]:
        plan = restarts(rows, horizon, x)
        return roll(kernel, x, rows.u, rows.dt, p, plan)

    middle = run(x0, take(window, 0, half))[0]
    x, usual = run(x0, window)
    own, rows = given(model, p), 0
    for other in (middle, x):
        off = np.abs(run(np.where(own, x0, other), window)[1] - usual)
        told = (off > LITTLE * np.nanstd(usual, axis=0)).any(axis=1)
        rows = max(rows, len(told) - int(np.argmax(told[::-1])) if told.any() else 0)
    return rows
