"""Has a watched input left the range that the live correction was learned for?"""

from __future__ import annotations

import numpy as np

from evertwin.fold import Block
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TwinState
from evertwin.types import Bool, Float64


def outside(
    now: Float64[np.ndarray, "... inputs"], learned: Float64[np.ndarray, "inputs 2"]
) -> Bool[np.ndarray, "..."]:
    """Which values lie farther outside the (low, high) of their input than a tenth of its range."""
    low, high = learned.T
    room = 0.1 * (high - low) + 1e-9
    return np.asarray((now < low - room) | (now > high + room))


def crossed(setup: Setup, state: TwinState, piece: Block, beats: np.ndarray) -> int:
    """The first of the beats in a piece that follows ``state``; -1: there is none."""
    columns = [setup.model.inputs.index(name) for name in setup.spec.correction.watch]
    last = (state.ring.end - 1) % setup.ring.capacity
    before = np.concatenate([state.ring.u[last : last + 1], piece.u])[beats - piece.row]
    found = np.flatnonzero(outside(before[:, columns], state.watched).any(axis=1))
    return int(beats[found[0]]) if len(found) else -1
