"""The report of lives and plan."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from evertwin.prognosis.laws import Life
from evertwin.prognosis.laws.plans.planning import Plan
from evertwin.prognosis.outlook.lives import ComponentLife, Lives
from evertwin.report.charts import inline
from evertwin.report.html import write_page
from evertwin.report.life_pictures import draw_indicator

WORDS = {"s": "seconds", "h": "hours", "d": "days"}
"""Clocks of time, in words; the others (run, cycle) are words."""


def write_prognosis(lives: Lives, plan: Plan | None, path: Path) -> None:
    """Writes the report.

    Raises:
        UsageError: the file cannot be written.
    """
    content: Any = lives.to_dict()
    pictures = [
        (
            f"{one.component}: {one.indicator.name}",
            _caption(one),
            inline(draw_indicator(one), _caption(one)),
        )
        for one in lives.indicators
    ]
    write_page("prognosis.html", path, {
        "name": lives.name, "life": content, "lives": lives, "pictures": pictures, "plan": plan,
        "timeline": _timeline(plan, lives), "units": WORDS,
        "planned": any(one.phases for one in lives.indicators),
    })  # fmt: skip


def _caption(one: ComponentLife) -> str:
    """What is known, and where the limit comes from."""
    limit = one.indicator.limit
    told = f"{one.sentence[0].upper()}{one.sentence[1:]}."
    return f"{told} Limit {one.indicator.shown(limit.value)}: {limit.source}."


def _timeline(plan: Plan | None, lives: Lives) -> list[dict[str, Any]]:
    """Of each planned component: where its life ends and its date, in % of the longest life."""
    every = () if plan is None else plan.items
    known = [(item, lives.components[item.component].life) for item in every]
    rows = [(item, life) for item, life in known if isinstance(life, Life)]
    ends = [end for _, life in rows for end in (*life.interval95, 3.0 * life.median)]
    far = max((end for end in ends if np.isfinite(end)), default=0.0) or 1.0

    def at(*times: float) -> list[float]:
        return [100.0 * min(time / far, 1.0) for time in times]

    return [
        {"item": item, "far": at(*life.interval95), "near": at(*life.interval80),
         "median": at(life.median)[0], "after": at(item.after)[0]}
        for item, life in rows
    ]  # fmt: skip
