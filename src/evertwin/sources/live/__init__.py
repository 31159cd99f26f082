"""Live sources: machines that speak, files that grow, and recordings replayed as if live.

`open_live` makes the source of a protocol; what it gives are chunks in SI by the twin file's own
channels, what it tells is its `Health`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.sources.live.contract import (
        Around as Around,
        Health as Health,
        LiveSettings as LiveSettings,
        LiveSource as LiveSource,
        check_live as check_live,
    )
    from evertwin.sources.live.registry import open_live as open_live, settings_of as settings_of

__getattr__ = surface(__name__)
