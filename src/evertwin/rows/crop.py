"""From the first to the last motion of a finished task: what a fit learns from."""

from __future__ import annotations

import numpy as np

from evertwin.config.spec import TwinSpec
from evertwin.errors import ConfigError
from evertwin.fold import Block, take
from evertwin.models import Model
from evertwin.rows.channels import recorded_as


def cropped(task: Block, spec: TwinSpec, model: Model) -> Block | None:
    """The rows of a task that ``[clock.crop]`` keeps; None where none is left.

    Raises:
        ConfigError: a channel of the crop is none of the model's.

    >>> from evertwin.config.spec import ClockSpec, CropSpec, ModelSpec
    >>> from evertwin.fold import make_block
    >>> from evertwin.machines.mobile import Robot1D
    >>> crop = CropSpec(channels=("v",), above=0.1, inside=1.0)
    >>> spec = TwinSpec("cart", ModelSpec("robot1d"), clock=ClockSpec(crop=crop))
    >>> rows = make_block(np.arange(7) * 10**9, [[0], [0], [1], [1], [1], [1], [0]], [[0]] * 7)
    >>> cropped(rows, spec, Robot1D()).row
    3
    """
    rule = spec.clock.crop
    if rule is None:
        return task
    moving = np.zeros(len(task.t), dtype=np.bool_)
    for name in rule.channels:
        moving |= np.abs(_column(task, name, spec, model)) > rule.above
    moves = np.flatnonzero(moving)
    if len(moves) == 0:
        return None
    inside = round(rule.inside * 1e9)
    first = int(np.searchsorted(task.t, task.t[moves[0]] + inside))
    last = int(np.searchsorted(task.t, task.t[moves[-1]] - inside, side="right"))
    if last <= first:
        return None
    kept = take(task, first, last)
    dt, gap = kept.dt.copy(), kept.gap.copy()
    dt[0], gap[0] = 0.0, True
    return kept._replace(dt=dt, gap=gap)


def _column(task: Block, name: str, spec: TwinSpec, model: Model) -> np.ndarray:
    """A channel of the model by its own name or by that of its recording."""
    for layout, values in ((model.inputs, task.u), (model.outputs, task.y)):
        for k, own in enumerate(layout.names):
            if name in (own, recorded_as(spec, own)):
                return values[:, k]
    there = ", ".join((*model.inputs.names, *model.outputs.names))
    raise ConfigError(
        f"[clock.crop] channels: expected channels of the model ({there}) or their recordings, "
        f"got {name!r}"
    )
