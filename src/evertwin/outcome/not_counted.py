"""Measured rows that the figures of a run are not of: how many, of which outputs and why."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from evertwin.fold import Mark
from evertwin.types import Bools, Int64

if TYPE_CHECKING:
    from evertwin.outcome.result import RunResult


def uncounted(result: RunResult) -> list[str]:
    """Lines of a report. A row that is marked as pushed while nothing told of it was in doubt: what
    seemed to push it turned out to go with the machine's own motion."""
    row = result.trace.get("row", np.empty(0))
    if not len(row):
        return []
    since = row >= result.unseen_since
    told, row = _told(result, row[since]), row[since]
    found = dict[str, list[str]]()
    for name, own in zip(result.outputs, result.trace["mark"][since].T, strict=True):
        pushed = own == Mark.EXTERNAL
        reasons = {
            "in error": own == Mark.ERROR,
            "pushed from outside": pushed & told,
            "in doubt (a push, or the model)": pushed & ~told,
        }
        counts = {why: result.every * np.count_nonzero(which) for why, which in reasons.items()}
        said = ", ".join(f"{count} {why}" for why, count in counts.items() if count)
        found.setdefault(said, []).append(name)
    return [f"  rows left out of {', '.join(who)}: {said}" for said, who in found.items() if said]


def _told(result: RunResult, row: Int64[np.ndarray, " n"]) -> Bools:
    """Rows of what was told to act from outside; one that went on as it was told lasts as
    long as rows are marked."""
    told = np.zeros(len(row), dtype=np.bool_)
    for event in result.of_kind("external"):
        found: Any = event.evidence
        first, last = found["first"], found["last"]
        if last < 0:  # it ends where rows are no longer marked
            marked = (result.trace["mark"][-len(row) :] == Mark.EXTERNAL).any(axis=1)
            calm = row[(row > event.row) & ~marked]
            last = calm.min(initial=row[-1] + 1)
        told |= (row >= first) & (row <= last)
    return told
