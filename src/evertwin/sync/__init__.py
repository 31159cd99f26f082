"""Synchronisation: simulated and measured data side by side, and which of the two to trust.

`evertwin.sync.lag` (the transport lag that all axes share) is imported by itself: it needs SciPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.sync.align import Align, AlignState, Feed, Rows
    from evertwin.sync.arbiter import Arbiter, Phases, Rule
    from evertwin.sync.horizon import (
        Horizon,
        HorizonRows,
        HorizonState,
        residuals,
        restarts,
        trusted,
    )
    from evertwin.sync.track import Track, TrackRows, TrackState

__all__ = [
    "Align",
    "AlignState",
    "Arbiter",
    "Feed",
    "Horizon",
    "HorizonRows",
    "HorizonState",
    "Phases",
    "Rows",
    "Rule",
    "Track",
    "TrackRows",
    "TrackState",
    "residuals",
    "restarts",
    "trusted",
]

__getattr__ = surface(__name__)
