"""First rows of a recording that lie far from where all others go on from: no measurement.

A logger writes zeros until its sensor answers, or one value that was left from before. A state that
adopts it is elsewhere in the next rows, by far more than it ever goes in one; a fit that predicts
from there would bend each number to that one leap.
"""

from __future__ import annotations

import numpy as np

from evertwin.fold import Block, Mark
from evertwin.setup.setup import Setup
from evertwin.signals import wrap

FIRST = 25
"""Samples that a recording may begin wrongly with."""
LEAST = 50
"""Samples behind them that tell how far a channel goes from one to the next."""
LEAP = 10.0
"""Times the largest of these steps."""


def rightly_begun(setup: Setup, window: Block) -> Block:
    """The rows, the first without the outputs that a state adopts, where one of these leaps once
    and never again."""
    outputs, stop = np.flatnonzero(setup.adopts), 0
    for k in outputs.tolist():
        rows = np.flatnonzero(np.isfinite(window.y[:, k]))
        angles = setup.model.outputs.angles[k : k + 1]
        steps = np.abs(wrap(np.diff(window.y[rows, k])[:, None], angles))[:, 0]
        if len(steps) < FIRST + LEAST:
            continue
        place = int(np.argmax(steps[:FIRST]))
        if steps[place] > LEAP * steps[place + 1 :].max() > 0.0:
            stop = max(stop, int(rows[place]) + 1)
    if not stop:
        return window
    y, mark = window.y.copy(), window.mark.copy()
    y[:stop, outputs], mark[:stop, window.u.shape[1] + outputs] = np.nan, Mark.ERROR
    return window._replace(y=y, mark=mark)
