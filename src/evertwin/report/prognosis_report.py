"""The report of lives and plan."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from evertwin.prognosis.component import ComponentLife
from evertwin.prognosis.laws.planning import Plan
from evertwin.prognosis.lives import Lives
from evertwin.report.html import encoded, write_page
from evertwin.report.life_pictures import draw_indicator, draw_plan

UNITS = {"s": "seconds", "h": "hours", "d": "days"}
"""Clocks of time, in words; the others (run, cycle) are words."""


def write_prognosis(lives: Lives, plan: Plan | None, path: Path) -> None:
    """Writes the report.

    Raises:
        UsageError: the file cannot be written.
    """
    content: Any = lives.to_dict()
    pictures = [
        (f"{one.component}: {one.indicator.name}", _caption(one), encoded(draw_indicator(one)))
        for one in lives.indicators
    ]
    timeline = None if plan is None or not plan.items else encoded(draw_plan(plan, lives))
    write_page("prognosis.html", path, {
        "name": lives.name, "life": content, "lives": lives, "pictures": pictures, "plan": plan,
        "timeline": timeline, "units": UNITS,
        "planned": any(one.phases for one in lives.indicators),
    })  # fmt: skip


def _caption(one: ComponentLife) -> str:
    """What is known, and where the limit comes from."""
    limit = one.indicator.limit
    told = f"{one.sentence[0].upper()}{one.sentence[1:]}."
    return f"{told} Limit {one.indicator.shown(limit.value)}: {limit.source}."
