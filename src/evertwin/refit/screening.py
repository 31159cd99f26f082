"""Rows without what cannot be a measurement: for fits, which look at recordings without the loop.

The arbiter's plausibility (range, rate, codes for no value, frozen, off by a factor) speaks of the
sensor, so it holds for a fit too. Its gate speaks of the model, which is what a fit is about to
change: what lies outside the gate stays, unless it is far outside everything else in the channel.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from evertwin.fold import Block, Mark
from evertwin.models import Model
from evertwin.setup.setup import Setup
from evertwin.types import Outputs, ParameterVector

FAR = 100.0
"""Distance from the median, in widths of the middle 98 % of the channel, that is absurd."""


def screened(
    setup: Setup, model: Model, p: ParameterVector, windows: Iterable[Block]
) -> tuple[Block, ...]:
    """The windows, with outputs marked as errors that are none of the machine's doing."""
    track = setup.track(model)
    state, nu = track.renew(track.init(), p), len(model.inputs)
    out = list[Block]()
    for window in windows:
        state, seen = track.step(state, window)
        bad = (seen.rows.mark == Mark.ERROR) | _far(window.y)
        mark = np.concatenate([seen.rows.doubt, window.mark[:, nu:]], axis=1)
        mark[:, nu:] = np.where(bad, np.uint8(Mark.ERROR), mark[:, nu:])
        out.append(window._replace(u=seen.rows.u, mark=mark))
    return tuple(out)


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
