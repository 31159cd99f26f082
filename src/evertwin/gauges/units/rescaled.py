"""Is a recorded channel, from which inputs of a static map come, one number times what it was?

A number that divides two units, or turns a sign, is undone on all inputs that are proportional to
the channel: of a position that is recorded in another unit, speed and acceleration are too. It is
told where next to nothing of the deviation is left, of all outputs together. At the change itself
derivatives jump; so the worst rows do not count.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from evertwin.errors import TooFew
from evertwin.fold import Windows
from evertwin.gauges.rows.sensor_change import LEAST, SensorChange, since_change, unmeasured
from evertwin.gauges.units.kinematic import contradicted
from evertwin.models import Model
from evertwin.models.batch import mapped
from evertwin.rows.channels import measured
from evertwin.setup.evaluation import predict
from evertwin.setup.setup import Setup
from evertwin.signals.mistaken import SIGN, numbers
from evertwin.signals.sizes import rms
from evertwin.types import Inputs, Outputs, ParameterVector, Vector

LEFT = 0.01
"""Largest share of the deviation's square that the number leaves."""
LOOKS = 0.1
"""The same of a few rows as they were recorded, before any filter."""
SPREAD = 256
"""Rows that each number is tried on, spread over those since a change."""
WORST = 0.05
"""Share of the rows that do not count: those that are worst once the number is undone."""


def rescaled(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows,
    beside: tuple[Outputs, SensorChange | None],
) -> SensorChange | None:  # fmt: skip
    """The channel, on the rows since the deviation has been what it is; None: it is none.

    Args:
        setup: of the twin.
        model: a static map.
        p: its parameters as they held, (np,).
        windows: the rows.
        beside: the deviation, (n, ny), and the output whose number is a rival; that has to leave
            more than twice as much.

    Raises:
        TooFew: it looks so, on fewer rows than a deviation is judged on.
    """
    deviation, rival = beside
    first = since_change(deviation[:, setup.watched])
    u, dt, y = (np.concatenate([getattr(w, n) for w in windows]) for n in ("u", "dt", "y"))
    rows = np.unique(np.linspace(first, len(u) - 1, SPREAD).round().astype(int))
    u, dt, y = u[rows], dt[rows], y[rows][:, setup.watched]
    if not np.isfinite(y).any(axis=0).all():
        return None
    scale = rms(y)

    def off(inputs: Inputs, measured: Outputs, moving: np.ndarray) -> Vector:
        left = (measured - mapped(model, inputs, dt, p)[:, setup.watched]) / scale
        return _squares(np.where(moving[:, setup.watched], left, np.nan))

    best = LOOKS, "", 1.0, ""
    if rival is not None and rival.number:
        names = [c.name for c, on in zip(model.outputs, setup.watched, strict=True) if on]
        divided = np.where([n == rival.channel for n in names], y / rival.number, y)
        moving = setup.moving(u)
        best = min(best, (0.5 * _left(off(u, divided, moving), off(u, y, moving)), "", 1.0, ""))
    channels, ones = measured(setup.spec, model.inputs), np.ones((1, u.shape[1]))
    for name, (columns, unit) in channels.items():
        for known, told in numbers(unit):
            other = _divided(u, columns, known)
            moving = setup.moving(other)  # friction at rest may be anything
            left = _left(off(other, y, moving), off(u, y, moving))
            if left < best[0] and not contradicted(
                setup, windows, (first, len(deviation)), _divided(ones, columns, known)[0]
            ):
                best = left, name, known, told
    _, name, number, told = best
    if not name:
        return None
    columns = channels[name][0]
    left = _reached(
        setup, model, p, windows, first, partial(_divided, columns=columns, number=number)
    )
    known = len(deviation) if left > LEFT else len(deviation) - first
    if left > LEFT and known >= setup.enough:
        return None
    if known < setup.enough:
        raise TooFew(f"{known} rows do not tell a change of unit from another")
    explains = f"read so, {100 - 100 * left:.1f} % of the squared deviation is gone"
    if number == SIGN:
        moving = setup.moving(u)
        turned = _left(off(u, -y, moving), off(u, y, moving)) <= LOOKS
        outputs = [c.name for c, on in zip(model.outputs, setup.watched, strict=True) if on]
        either = f", or of {' and '.join(outputs)}," if turned else ""
        looks = f"the sign of {name}{either} looks turned"
    else:
        looks = f"{name} looks {number:.4g} times what it is, as {told} would make it"
    return SensorChange(name, number, (
        f"{looks}: {explains}, so nothing is learned; a machine that changed so would look the same"
    ))  # fmt: skip


def _divided(u: Inputs, columns: list[int], number: float) -> Inputs:
    other = u.copy()
    other[:, columns] /= number
    return other


@unmeasured()
def _reached(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows, first: int,
    undone: Callable[[Inputs], Inputs],
) -> float:  # fmt: skip
    """Share of the squared deviation that is left as the twin judges it, behind its filter, from
    row ``first`` on; 1 where the twin is not within its requirement then."""
    old = [predict(setup, model, p, one) for one in windows]
    new = [predict(setup, model, p, one._replace(u=undone(one.u))) for one in windows]
    moving = np.concatenate([one.moving for one in new])
    on = slice(first, None), setup.watched
    before, after = (
        np.where(moving, np.concatenate([one.residual for one in some]), np.nan)[on]
        for some in (old, new)
    )
    scale = rms(np.concatenate([one.measured for one in new])[on])
    limit = setup.requirement if setup.relative else setup.requirement / scale
    left = _left(_squares(after / scale), _squares(before / scale))
    best = _best(_squares(after / scale))
    off = np.sqrt(np.nanmean(np.square(after[best] / scale), axis=0)) if len(best) else np.inf
    return left if np.all(off <= limit) else 1.0


def _squares(residual: Outputs) -> Vector:
    """Of each row; NaN where no output counts, (n,)."""
    known = np.isfinite(residual).any(axis=1)
    return np.where(known, np.nansum(np.square(residual), axis=1), np.nan)


def _best(after: Vector) -> np.ndarray:
    """Positions of the rows that count, without the worst."""
    known = np.count_nonzero(np.isfinite(after))
    return np.argsort(after)[: round((1.0 - WORST) * known)]


def _left(after: Vector, before: Vector) -> float:
    """Share of the squares that is left; infinite where few rows count."""
    best = _best(after)
    enough = len(best) >= LEAST and before[best].sum() > 0
    return float(after[best].sum() / before[best].sum()) if enough else np.inf
