"""Events that an answer to slow work says, as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from evertwin.fold import Windows
from evertwin.gauges.rows.sensor_change import SensorChange
from evertwin.ledger.caveats import in_doubt_of
from evertwin.rows.ring import called
from evertwin.tuning import Fit, Problem
from evertwin.tuning.posing.recordings import beginning


def event(kind: str, signal: str, reason: str, evidence: Mapping[str, Any]) -> dict[str, Any]:
    """One event.

    >>> event("abnormal", "w", "its sign looks turned", {})["kind"]
    'abnormal'
    """
    return {"kind": kind, "signal": signal, "reason": reason, "evidence": dict(evidence)}


def changed_since(new: Windows, held: bool = True) -> dict[str, Any]:
    """The machine changed; ``new`` are the rows since then. Of a version that never ``held`` a form
    that is wrong there looks the same."""
    other = "" if held else ", or the form is wrong from there on, for it never held"
    said = f"the machine changed at {called(new[0].row)}{other}: rows before it are left out"
    rows = sum(len(block.t) for block in new)
    evidence = {"row": new[0].row, "time": int(new[0].t[0]), "rows": rows}
    return event("changed", "", said, evidence)


def goes_on(new: Windows) -> dict[str, Any]:
    """The machine changes all the while; ``new`` are the rows that tell what it is now."""
    said = f"the machine goes on changing: what it is now is told by rows from {called(new[0].row)}"
    return event("changed", "", said, {"row": new[0].row, "time": int(new[0].t[0])})


def not_told(problem: Problem, fit: Fit) -> list[dict[str, Any]]:
    """An event for each number of the machine that the rows do not determine."""
    begins = beginning(problem.model, fit.names)
    return [
        event("not_identifiable", name, reason, {"verdict": verdict})
        for name, reason, verdict in zip(fit.names, fit.reasons, fit.verdict, strict=True)
        if verdict == "not" and name not in begins
    ]


def of_a_sensor(found: SensorChange, *events: dict[str, Any]) -> dict[str, Any]:
    """The content of an answer: a channel is not what it was, or is said to be; nothing is learned
    from it, and nothing that was learned from it stays on trial."""
    evidence = {"number": found.number, "since": found.since}
    said = event("abnormal", found.channel, found.said, evidence)
    return {
        "events": [*events, said], "sensor": found.channel, "refused": found.refused,
        "lasts": found.since is not None,
    }  # fmt: skip


def against(content: Mapping[str, Any]) -> str:
    """What speaks against the numbers of an answer until a trial has proven them, where the version
    had held; empty: nothing does.

    >>> against({"events": [event("abnormal", "", "tuning drives c to a bound", {})]})
    'tuning drives c to a bound'
    """
    for one in content["events"]:
        alike, reason = in_doubt_of(one["reason"]), str(one["reason"])
        if alike or one["kind"] in ("abnormal", "corrected") or one["evidence"].get("short"):
            return alike[0] if alike else reason
    return ""


UNDONE = {
    "fit": "nothing could be tuned", "correct": "no correction could be sought",
    "retell": "nothing could be told anew",
    "state": "no state could be sought", "refine": "a state could not be told better",
}  # fmt: skip


def undone(kind: str, why: object) -> dict[str, Any]:
    """What the answer says of work that could not be done.

    >>> undone("correct", ValueError("too few rows"))["events"][0]["reason"]
    'no correction could be sought: too few rows'
    """
    return {"events": [event("rejected", "", f"{UNDONE[kind]}: {why}", {})]}
