"""Axes that stand for all of a window: what their speeds say is noise, and tells nothing.

A tuner would take it for motion: each sign of it for one of friction, each leap for an inertia's.
So the speed and the acceleration of what stands are zero, and what it does not excite stays.
"""

from __future__ import annotations

import numpy as np

from evertwin.fold import Block
from evertwin.rows.channels import courses
from evertwin.setup.setup import Setup
from evertwin.signals.at_rest import stands


def at_rest(setup: Setup, window: Block) -> Block:
    """The rows, without the noise of speeds and accelerations of axes that stand all the while."""
    u = window.u
    for position, speed, *acceleration in courses(setup.model.inputs):
        dt = window.dt[window.dt > 0]
        usual = float(np.median(dt)) if len(dt) else 0.0
        if u[:, speed].any() and stands(u[:, position], u[:, speed], usual):
            u = u.copy() if u is window.u else u
            columns = [speed, *acceleration]
            u[:, columns] = np.where(np.isfinite(u[:, columns]), 0.0, u[:, columns])
    return window if u is window.u else window._replace(u=u)
