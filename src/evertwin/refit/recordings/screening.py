"""Rows without what cannot be a measurement: for fits, which look at recordings without the loop.

The arbiter's plausibility (range, rate, codes for no value, frozen, off by a factor) speaks of the
sensor, so it holds for a fit too. Its gate speaks of the model, which is what a fit is about to
change: what lies outside the gate stays, unless it is far outside everything else in the channel.
A row at which a user's step raises something is left out as one without inputs is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from evertwin.errors import ModelError
from evertwin.fold import Block, Mark, Record
from evertwin.models import Model
from evertwin.models.functions.failures import Failed
from evertwin.setup.at_rest import at_rest
from evertwin.setup.false_start import rightly_begun
from evertwin.setup.setup import Setup
from evertwin.types import Outputs, ParameterVector

FAR = 100.0
"""Distance from the median, in widths of the middle 98 % of the channel, that is absurd."""


class Screened(NamedTuple):
    """Rows, those that the model could not compute, and how many have no value of an input.

    >>> Screened((), None, {}).rows
    ()
    """

    rows: tuple[Block, ...]
    failed: Failed | None
    unknown: Mapping[str, int]


def screened(setup: Setup, model: Model, p: ParameterVector, windows: Iterable[Block]) -> Screened:
    """The windows, with outputs marked as errors that are none of the machine's doing.

    Raises:
        ModelError: the model's step raised something at every row.
    """
    track = setup.track(model)
    state, nu = track.renew(track.init(), p), len(model.inputs)
    out, said, unknown = list[Block](), list[Record](), np.zeros(nu, dtype=np.int64)
    for window in windows:
        known = np.isfinite(window.u)  # what acted before the first command was never recorded
        unknown += (~known & np.maximum.accumulate(known, axis=0)).sum(axis=0)
        window = at_rest(setup, rightly_begun(setup, window))
        state, seen = track.step(state, window)
        early = window.mark[:, nu:] == Mark.ERROR
        bad = (seen.rows.mark == Mark.ERROR) | early | _far(window.y)
        mark = np.concatenate([seen.rows.doubt, window.mark[:, nu:]], axis=1)
        mark[:, nu:] = np.where(bad, np.uint8(Mark.ERROR), mark[:, nu:])
        out.append(window._replace(u=seen.rows.u, mark=mark))
        said += seen.records
    failed = state.failed(said)
    if failed and failed.all:
        raise ModelError(str(failed))
    counts = zip(model.inputs.names, unknown.tolist(), strict=True)
    return Screened(tuple(out), failed, {name: count for name, count in counts if count})


def _far(y: Outputs) -> np.ndarray:
    """Values far outside the rest of their channel, (n, ny)."""
    far = ~np.isfinite(y) & ~np.isnan(y)
    for k in range(y.shape[1]):
        known = y[np.isfinite(y[:, k]), k]
        if len(known) < 20:
            continue
        low, middle, high = np.quantile(known, [0.01, 0.5, 0.99])
        if high > low:
            with np.errstate(invalid="ignore", over="ignore"):
                far[:, k] |= np.abs(y[:, k] - middle) > FAR * (high - low)
    return np.asarray(far)
