"""Recordings of a one-axis robot with planted faults; the truth beside them."""

from __future__ import annotations

import numpy as np

from evertwin.fold import Block

from .machines import drive_rows

FAULTS = ("clean", "spikes", "stuck", "wrong unit", "jump")
ONSET, LENGTH = 200, 100


def recording(fault: str, seed: int) -> tuple[Block, np.ndarray]:
    """600 rows at 10 Hz, noise 1 cm, and the true position."""
    rng = np.random.default_rng(1000 + seed)
    block = drive_rows(seed, speed=0.16)
    truth = np.concatenate([[0.0], np.cumsum(block.u[1:, 0] * block.dt[1:])])
    y, span = block.y[:, 0], slice(ONSET, ONSET + LENGTH)
    if fault == "jump":
        truth[ONSET:] += 1.0
        y[ONSET:] += 1.0
    elif fault == "spikes":
        y[rng.choice(np.arange(30, 590, 12), 8, replace=False)] += rng.choice([-2.0, 2.0], 8)
    elif fault == "stuck":
        y[span] = y[ONSET]
    elif fault == "wrong unit":
        y[span] *= 1000.0
    return block, truth
