"""Synchronisation: simulated and measured data side by side, and which of the two to trust."""

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
    "Arbiter",
    "Horizon",
    "HorizonRows",
    "HorizonState",
    "Phases",
    "Rule",
    "Track",
    "TrackRows",
    "TrackState",
    "residuals",
    "restarts",
    "trusted",
]
