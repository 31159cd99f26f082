"""The fold of a whole twin: the driver, what it decides at each beat, runs on recordings and live
ones. The only room that knows all stages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.loop.by_hand import ByHand as ByHand
    from evertwin.loop.engines import Engines as Engines
    from evertwin.loop.live import Live as Live, Samples as Samples
    from evertwin.loop.loading import other_settings as other_settings, unloadable as unloadable
    from evertwin.loop.observer import Observer as Observer, Progress as Progress
    from evertwin.loop.run import Run as Run

__getattr__ = surface(__name__)
