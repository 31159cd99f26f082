"""The fold of a whole twin: driver, state, decisions, slow work, ledger, result. The only room that
knows all stages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.loop.by_hand import ByHand as ByHand
    from evertwin.loop.channels import check_units as check_units
    from evertwin.loop.comparison import Comparison as Comparison, compare as compare
    from evertwin.loop.configured_model import model_of as model_of
    from evertwin.loop.engines import Engines as Engines
    from evertwin.loop.feed import Data as Data, Feed as Feed, chunk_of as chunk_of
    from evertwin.loop.fitting import (
        FitResult as FitResult,
        Watch as Watch,
        fit as fit,
        posed as posed,
    )
    from evertwin.loop.kpi import Kpi as Kpi, kpi_of as kpi_of
    from evertwin.loop.label import Label as Label
    from evertwin.loop.ledger import Ledger as Ledger
    from evertwin.loop.live import Live as Live
    from evertwin.loop.loading import other_settings as other_settings, unloadable as unloadable
    from evertwin.loop.observer import Observer as Observer, Progress as Progress
    from evertwin.loop.result import RunResult as RunResult
    from evertwin.loop.run import Run as Run
    from evertwin.loop.samples import Numbered as Numbered
    from evertwin.loop.setup import Setup as Setup
    from evertwin.loop.versions import Versions as Versions
    from evertwin.loop.view import View as View
    from evertwin.loop.work import work_of as work_of

__getattr__ = surface(__name__)
