"""Synchronisation: simulated and measured data side by side, and which of the two to trust."""

from evertwin.sync.horizon import (
    Horizon,
    HorizonRows,
    HorizonState,
    residuals,
    restarts,
    trusted,
)

__all__ = ["Horizon", "HorizonRows", "HorizonState", "residuals", "restarts", "trusted"]
