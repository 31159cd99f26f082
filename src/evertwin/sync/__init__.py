"""Synchronisation: simulated and measured data side by side, and which of the two to trust.

`evertwin.sync.horizon.lag` (the transport lag of all axes) is imported by itself: it needs SciPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.sync.alignment.align import Align as Align, Feed as Feed
    from evertwin.sync.alignment.align_state import AlignState as AlignState, Rows as Rows
    from evertwin.sync.arbiter.arbiter import Arbiter as Arbiter, Phases as Phases, Rule as Rule
    from evertwin.sync.horizon.horizon import (
        Horizon as Horizon,
        residuals as residuals,
        restarts as restarts,
        trusted as trusted,
    )
    from evertwin.sync.horizon.horizon_state import (
        HorizonRows as HorizonRows,
        HorizonState as HorizonState,
    )
    from evertwin.sync.track.track import Track as Track
    from evertwin.sync.track_state import TrackRows as TrackRows, TrackState as TrackState

__getattr__ = surface(__name__)
