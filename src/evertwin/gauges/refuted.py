"""Is a channel, which was said to be read wrongly, read rightly after all, by later rows alone?

A twin that never held is in doubt until somebody says what it was, unless later rows say so: read
as it was said to be, they would be far worse off than as they were recorded.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from evertwin.gauges.gauge_rows import FAR, LEAST, unchanged
from evertwin.gauges.misread import possible
from evertwin.gauges.sensor_change import unmeasured
from evertwin.setup.setup import Setup
from evertwin.setup.task import Windows
from evertwin.tuning import Problem
from evertwin.tuning.assemble import rms

CLEARLY = 2.0
"""So many times the squared deviation each such reading has to leave."""


@unmeasured()
def refuted(
    setup: Setup, pose: Callable[[Windows], Problem], windows: Windows, doubt: tuple[str, float]
) -> bool:
    """Would every reading of a channel by such a number leave clearly more than none does?

    Args:
        setup: of the twin.
        pose: the version as it is, on some rows.
        windows: rows that came after it was said.
        doubt: channel, and recorded over what fits.
    """
    (name, number), model, found = doubt, setup.model, False
    before = unchanged(pose(windows))
    size = rms(before)
    if np.isfinite(before).any(axis=1).sum() < LEAST:
        return False
    off = float(np.nansum(np.square(before / size)))
    for one in possible(setup, model):
        if name not in one.channels or not np.isclose(one.number, number, rtol=1e-3):
            continue
        factors = np.where(model.outputs.angles, 1.0, one.factors[len(model.inputs) :])
        left = unchanged(pose(tuple(one.undone(window) for window in windows))) / factors
        left = np.where(np.isfinite(before) & ~np.isfinite(left), FAR * size, left)
        if not float(np.nansum(np.square(left / size))) > CLEARLY * off:
            return False
        found = True
    return found
