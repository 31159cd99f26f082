"""From the history of parameters to remaining useful life, alarms and a maintenance plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.prognosis.alarm_log import alarmed
    from evertwin.prognosis.lives import Lives
    from evertwin.prognosis.prospect import Prospect
    from evertwin.prognosis.scenario_lives import run_scenario
    from evertwin.prognosis.upkeep import Verdict, label, maintenance, plan

__all__ = [
    "Lives",
    "Prospect",
    "Verdict",
    "alarmed",
    "label",
    "maintenance",
    "plan",
    "run_scenario",
]

__getattr__ = surface(__name__)
