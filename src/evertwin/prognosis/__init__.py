"""From the history of parameters to remaining useful life, alarms and a maintenance plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.prognosis.outlook.alarm_log import alarmed as alarmed
    from evertwin.prognosis.laws.plans.planning import Plan as Plan
    from evertwin.prognosis.outlook.lives import Lives as Lives
    from evertwin.prognosis.outlook.prospect import Prospect as Prospect
    from evertwin.prognosis.outlook.scenario_lives import run_scenario as run_scenario
    from evertwin.prognosis.outlook.upkeep import (
        Verdict as Verdict,
        label as label,
        maintenance as maintenance,
        plan as plan,
    )

__getattr__ = surface(__name__)
