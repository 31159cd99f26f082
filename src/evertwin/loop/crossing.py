"""Beats before which a watched input has left what the live correction was learned for."""

from __future__ import annotations

import numpy as np

from evertwin.fold import Block
from evertwin.loop.setup import Setup
from evertwin.loop.twin_state import TwinState


def crossed(setup: Setup, state: TwinState, piece: Block, beats: np.ndarray) -> int:
    """The first of the beats in a piece that follows ``state``; -1: there is none."""
    if not len(state.watched):
        return -1
    columns = [setup.model.inputs.index(name) for name in setup.spec.correction.watch]
    last = (state.ring.end - 1) % setup.ring.capacity
    before = np.concatenate([state.ring.u[last : last + 1], piece.u])[beats - piece.row]
    now, (low, high) = before[:, columns], state.watched.T
    room = 0.1 * (high - low) + 1e-9
    outside = (now < low - room) | (now > high + room)
    found = np.flatnonzero(outside.any(axis=1))
    return int(beats[found[0]]) if len(found) else -1
