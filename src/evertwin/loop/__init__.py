"""The fold of a whole twin: driver, state, decisions, slow work, ledger, result. The only room that
knows all stages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.loop.channels import check_units
    from evertwin.loop.comparison import Comparison, compare
    from evertwin.loop.configured_model import model_of
    from evertwin.loop.engines import Engines
    from evertwin.loop.feed import Data, Feed, chunk_of
    from evertwin.loop.fitting import FitResult, Watch, fit, posed
    from evertwin.loop.ledger import Ledger
    from evertwin.loop.live import Live, View
    from evertwin.loop.observer import Observer
    from evertwin.loop.result import RunResult
    from evertwin.loop.run import Run
    from evertwin.loop.setup import Setup
    from evertwin.loop.versions import Versions
    from evertwin.loop.work import work_of

__all__ = [
    "Comparison",
    "Data",
    "Engines",
    "Feed",
    "FitResult",
    "Ledger",
    "Live",
    "Observer",
    "Run",
    "RunResult",
    "Setup",
    "Versions",
    "View",
    "Watch",
    "check_units",
    "chunk_of",
    "compare",
    "fit",
    "model_of",
    "posed",
    "work_of",
]

__getattr__ = surface(__name__)
