"""What no model of recordings can foretell: noise, and how far apart rows are."""

from __future__ import annotations

import numpy as np

from evertwin.config.spec import TwinSpec
from evertwin.errors import DataError, ModelError
from evertwin.fold import Block
from evertwin.fold.block import first
from evertwin.gauges.noise import between, noise
from evertwin.refit.workers import setup_of
from evertwin.rows.feed import Feed

ROWS = 20_000
"""Rows that it is told from."""


def unforeseen(spec: TwinSpec) -> float:
    """Rms [SI] of the output that is foretold worst, over the horizon of a twin file; 0: its rows
    do not tell, which the doctor says more about.

    Args:
        spec: of a model with states, whose recordings are where it says.
    """
    setup, windows, count = setup_of(spec), list[Block](), 0
    model = setup.model
    p = model.parameters.values
    try:
        for block in Feed(spec, model).blocks():
            windows.append(block)
            count += len(block.t)
            if count >= ROWS:
                break
        rows = first(tuple(windows), ROWS)
        level = noise(setup, model, p, rows) * np.where(setup.adopts, np.sqrt(2.0), 1.0)
        found = np.hypot(np.nan_to_num(level), between(setup, model, p, rows))
    except (DataError, ModelError):  # the file is written all the same
        return 0.0
    known = found[setup.watched & np.isfinite(found)]
    return float(known.max(initial=0.0))
