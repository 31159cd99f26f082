"""What slow work says of itself: events as its answer has them, in plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from evertwin.loop.ring import called
from evertwin.loop.task import Windows


def event(kind: str, signal: str, reason: str, evidence: Mapping[str, Any]) -> dict[str, Any]:
    """One event.

    >>> event("tuned", "", "tuned Fc", {})["kind"]
    'tuned'
    """
    return {"kind": kind, "signal": signal, "reason": reason, "evidence": dict(evidence)}


def changed_at(new: Windows) -> dict[str, Any]:
    """That the machine is another one, of the rows since then."""
    said = f"the machine changed at {called(new[0].row)}: rows before it are left out"
    rows = sum(len(block.t) for block in new)
    return event(
        "changed", "", said, {"row": new[0].row, "time": int(new[0].t[0]), "rows": rows}
    )  # fmt: skip


def rejected(reason: str) -> dict[str, Any]:
    """What the answer says of work that could not be done."""
    return {"events": [event("rejected", "", reason, {})]}
