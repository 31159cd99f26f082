"""What a machine makes of a command: per prediction over one horizon, in the command's own unit.

The residual of a prediction, divided by how much the prediction changes with the command, is what
the command would have to be changed by for the model to agree. Command plus that is the effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evertwin.correction.evidence import gather
from evertwin.fold import Block
from evertwin.models import Model
from evertwin.types import ParameterVector, Vector

TRIM = 0.02
"""Share of effects at either end that count as outliers."""


def command_effects(
    model: Model, p: ParameterVector, windows: Sequence[Block], channel: str, horizon: float
) -> tuple[Vector, Vector]:
    """Mean command and effect of each segment on which the command acts, (k,) each.

    Raises:
        DataError: the windows hold no segment.

    >>> from evertwin.fold import make_block
    >>> from evertwin.machines.mobile import Robot1D
    >>> t, v = np.arange(60), np.tile([0.1, 0.2], 30)
    >>> rows = make_block(t=t * 10**9, u=v[:, None], y=0.8 * np.cumsum(v)[:, None])
    >>> command, effect = command_effects(Robot1D(), np.ones(1), (rows,), "v", 1.0)
    >>> bool(np.allclose(effect, 0.8 * command))
    True
    """
    seen = gather(model, windows, horizon, p=p)
    column, count = model.inputs.index(channel), seen.segments
    step = 1e-3 * max(float(np.nanmax(np.abs(seen.u[:, column]))), 1e-6)
    u = seen.u.copy()
    u[:, column] += step
    r = seen.residual(model, p)
    slope = (r - replace(seen, u=u).residual(model, p)) / step
    top = np.bincount(seen.segment, (r * slope).sum(axis=1), count)
    base = np.bincount(seen.segment, (slope**2).sum(axis=1), count)
    number = np.maximum(np.bincount(seen.segment, minlength=count), 1)
    command = np.bincount(seen.segment, seen.u[seen.rows, column], count) / number
    good = base > 1e-3 * base.max(initial=0.0)
    effect = command[good] + top[good] / base[good]
    if len(effect):
        effect = np.clip(effect, *np.quantile(effect, [TRIM, 1 - TRIM]))
    return command[good], effect
