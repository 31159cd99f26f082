"""The parameter history that follows from what a fit, or a recursion, has said."""

from __future__ import annotations

import math
from typing import Any

from evertwin.store import Estimate


def estimates(content: Any, version: int, row: int, before: tuple[int, int]) -> list[Estimate]:
    """One entry per tuned parameter.

    Args:
        content: of the answer, as an answer from the log has it.
        version: that was tuned.
        row: at which it was said.
        before: tasks of the runs before this one, and the time within them [ns].
    """
    fit = content.get("fit")
    if not fit:
        return []
    found = []
    for name, item in sorted(fit["parameters"].items()):
        low, high = item["interval95"]
        bounds = (-math.inf if low is None else low, math.inf if high is None else high)
        when = [int(content.get(key, 0)) for key in ("time", "task", "elapsed")]
        value, verdict = item["value"], item["verdict"]
        counts = (*when[1:], *before)
        found.append(Estimate(row, when[0], version, name, value, *bounds, verdict, *counts))
    return found
