"""Slow work: what a request asks of a window (tune, a simpler form, a correction, the cause), and
the fit of whole recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.refit.recordings.fitting import (
        FitResult as FitResult,
        Watch as Watch,
        fit as fit,
        posed as posed,
    )
    from evertwin.refit.work import work_of as work_of

__getattr__ = surface(__name__)
