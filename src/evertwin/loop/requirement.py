"""Is the live version off by more than the requirement?"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.loop.deviation import judged_deviation
from evertwin.loop.follow import NONE
from evertwin.loop.setup import Setup
from evertwin.loop.twin_state import TwinState


def deviates(
    setup: Setup, state: TwinState, task_end: bool
) -> tuple[str | None, str, dict[str, Any]]:
    """Reason, output, evidence; (None, …) when it is too early to say, ("", …) when it is not."""
    watch = state.scores.watch
    samples = max(watch.samples.tolist(), default=0)
    enough = samples >= setup.least if task_end else setup.watch(NONE).enough(state.scores)
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
