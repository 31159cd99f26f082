"""Synchronisation: simulated and measured data side by side, and which of the two to trust.

`evertwin.sync.lag` (the transport lag that all axes share) is imported by itself: it needs SciPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.sync.align import Align as Align, Feed as Feed
    from evertwin.sync.align_state import AlignState as AlignState, Rows as Rows
    from evertwin.sync.arbiter import Arbiter as Arbiter, Phases as Phases, Rule as Rule
    from evertwin.sync.horizon import (
        Horizon as Horizon,
        residuals as residuals,
        restarts as restarts,
        trusted as trusted,
    )
    from evertwin.sync.horizon_state import HorizonRows as HorizonRows, HorizonState as HorizonState
    from evertwin.sync.track import Track as Track
    from evertwin.sync.track_state import TrackRows as TrackRows, TrackState as TrackState

__getattr__ = surface(__name__)
