"""What a run says: its sentence, what is open, the result, its KPIs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.outcome.comparison import Comparison as Comparison, compare as compare
    from evertwin.outcome.kpi import Kpi as Kpi, kpi_of as kpi_of
    from evertwin.outcome.result import RunResult as RunResult
    from evertwin.outcome.view import View as View

__getattr__ = surface(__name__)
