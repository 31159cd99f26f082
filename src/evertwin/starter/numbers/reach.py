"""What no model of recordings can foretell: noise, and commands that change between two rows."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from evertwin.config.spec import TwinSpec
from evertwin.errors import DataError, ModelError
from evertwin.fold import Block
from evertwin.fold.block import first
from evertwin.gauges.changes.noise import noise
from evertwin.gauges.rows.unlike import changes
from evertwin.models import Model
from evertwin.rows.feed import Feed
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.signals import wrap
from evertwin.types import Outputs, ParameterVector, Vector

ROWS = 20_000
"""Rows that it is told from, at most."""
ENOUGH = 500
"""Rows that tell it, of which a third is looked at."""
LOOKS = (1, 2, 4, 8, 16)
"""Rows after which it is looked at what a command has made."""
CHANGES = 20
"""Changes of the commands below which it is not told when these come."""
PLAIN = 3.0
"""Times the noise that a row more of delay makes of a row, from which on its change counts."""
SILENT = 1e-3
"""Of what a row of delay makes: noise where a recording has none."""
UNLIKE = 2.0
"""Times what it can be, from which on a scatter is that of a model that is off otherwise."""
QUARTER = 0.25
"""Median distance of a uniform variate within [0, 1] from its median."""


def unforeseen(spec: TwinSpec) -> float:
    """Rms [SI, or a share where one is asked] of the output that is foretold worst, over the
    horizon of a twin file; 0: its rows do not tell, which the doctor says more about.

    Args:
        spec: of a model with states, whose recordings are where it says.
    """
    setup, windows, count = Setup(spec, model_of(spec, compiled=False)), list[Block](), 0
    model = setup.model
    p = model.parameters.values
    try:
        for block in Feed(spec, model).blocks():
            windows.append(block)
            count += len(block.t)
            if count >= ROWS:
                break
        rows = first(tuple(windows), min(ROWS, max(count // 3, ENOUGH)))  # it may change later
        level = np.nan_to_num(noise(setup, model, p, rows)) * np.where(setup.adopts, 2**0.5, 1.0)
        found = np.hypot(level, between(model, p, rows, setup.horizon, level))
    except (DataError, ModelError):  # the file is written all the same
        return 0.0
    found = found / setup.sizes(np.concatenate([one.y for one in rows]))
    known = found[setup.watched & np.isfinite(found)]
    return float(known.max(initial=0.0))


def between(
    model: Model, p: ParameterVector, windows: Sequence[Block], horizon: float, level: Vector
) -> Vector:
    """Rms of what each output is off by where commands change between two rows, which do not tell
    when, (ny,): of what a row more of delay makes over the horizon, as much as they come at times
    of their own after the row that tells of them.

    Args:
        level: of noise in a prediction, (ny,).
    """
    if not len(model.states):
        return np.zeros(len(model.outputs))
    made = np.sqrt(np.nanmean(np.square(_moved(model, p, windows, horizon, 1)[1]), axis=0))
    period = float(np.median(np.diff(np.concatenate([window.t for window in windows])))) * 1e-9
    for rows in LOOKS:  # what accelerates answers a row too late
        ahead = max(rows * period - 0.5 * period, 1e-9)
        apart = [_apart(*_moved(model, p, windows, ahead, late), level) for late in (1, -1)]
        if not all(map(math.isnan, apart)):
            return np.asarray(made * np.nanmax(apart) / math.sqrt(3.0))
    return np.asarray(made / math.sqrt(3.0))


def _moved(
    model: Model, p: ParameterVector, windows: Sequence[Block], horizon: float, rows: int
) -> tuple[Outputs, Outputs]:
    """What predictions are off by, and what commands that come rows later make of them, (n, ny)
    each."""
    off, made = list[Outputs](), list[Outputs]()
    for window in windows:
        at = np.clip(np.arange(len(window.u)) - rows, 0, len(window.u) - 1)
        both = (window, window._replace(u=window.u[at]))
        now, then = (changes(model, p, some, horizon) for some in both)
        off.append(wrap(now.measured - now.predicted, model.outputs.angles))
        made.append(wrap(then.predicted - now.predicted, model.outputs.angles))
    return np.concatenate(off), np.concatenate(made)


def _apart(off: Outputs, made: Outputs, level: Vector) -> float:
    """How far apart in a row the commands come, from 0 (all at one time) to 1 (at any time of it):
    by the scatter of how late each is, in rows, without that of noise. NaN where few tell; 0 where
    it is more than a row can hold: what is off then is no matter of when."""
    least = SILENT * np.sqrt(np.nanmean(np.square(made), axis=0)) + 1e-300
    off, made = (np.nan_to_num(one / np.maximum(level, least)) for one in (off, made))
    weight = np.square(made).sum(axis=1)
    plain = weight > PLAIN**2
    if np.count_nonzero(plain) < CHANGES:
        return math.nan
    late = (off * made).sum(axis=1)[plain] / weight[plain]
    noisy = 0.6745**2 * np.median(1.0 / weight[plain])
    scatter = np.median(np.abs(late - np.median(late))) ** 2 - noisy
    apart = math.sqrt(max(scatter, 0.0)) / QUARTER
    return min(apart, 1.0) if apart < UNLIKE else 0.0
