"""Is the live version off by more than the requirement?"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.loop.deviation import judged_deviation
from evertwin.loop.follow import NONE
from evertwin.loop.setup import Setup
from evertwin.loop.twin_state import TwinState

LITTLE = 1.0 / 3.0
"""Part of the requirement that a deviation has to reach for a detector's alarm to count: that a
residual is no longer what it was is no trouble while the twin is as true as is asked."""


def alarmed(setup: Setup, state: TwinState) -> bool:
    """Has a detector alarmed, about an output that is off by enough to matter?"""
    alarm = state.detect.pending
    if not alarm.kind or not np.isfinite(setup.requirement):
        return bool(alarm.kind)
    values = judged_deviation(state.scores.watch, setup.relative, state.scores.usual)
    off = values[setup.model.outputs.index(alarm.signal)]
    return bool(off >= LITTLE * setup.requirement)  # nothing moved: it cannot be told yet


def deviates(
    setup: Setup, state: TwinState, task_end: bool
) -> tuple[str | None, str, dict[str, Any]]:
    """Reason, output, evidence; (None, …) when it is too early to say, ("", …) when it is not."""
    watch = state.scores.watch
    samples = max(watch.samples.tolist(), default=0)
    rule = setup.watch(NONE, state.agenda.held)
    enough = samples >= setup.least if task_end else rule.enough(state.scores)
    if not np.isfinite(setup.requirement) or not enough:
        return None, "", {}
    values = judged_deviation(watch, setup.relative, state.scores.usual)
    values = np.where(setup.watched, values, np.nan)
    if not np.nanmax(values) > setup.requirement:
        return "", "", {}
    worst = int(np.nanargmax(values))
    name = setup.model.outputs.names[worst]
    shown = [setup.shown(k, values[k]) for k in range(len(values))]
    limit = setup.shown(worst, setup.requirement)
    evidence = {"deviation": values, "limit": setup.requirement, "rows": samples}
    return f"{name} is off by {shown[worst]} (limit {limit})", name, evidence
