"""What the operator said and did, as the store's log keeps it.

The log only grows, so nothing is taken out of it: a label that was withdrawn, or that cannot be
read, stays there and does not count. What counts and what does not is told here, in one place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from evertwin.fold import Event

DECISIONS = ("confirmed", "postponed", "declined")
DONE = ("replaced", "adjusted")
MAINTAINED, WITHDRAWN = "maintained", "withdrawn"

State = Literal["holds", "superseded", "withdrawn", "other clock", "unreadable"]


class Label(NamedTuple):
    """One thing that was said or done.

    >>> Label._fields
    ('event', 'state', 'problem')
    """

    event: Event
    state: State
    problem: str = ""
    """Why it cannot be read."""

    @property
    def verdict(self) -> str:
        """confirmed, postponed, declined, replaced or adjusted."""
        kind = self.event.evidence.get("kind")
        return kind if self.event.kind == MAINTAINED and isinstance(kind, str) else self.event.kind


def labels(events: Sequence[Event], clock: str) -> tuple[Label, ...]:
    """Every label in the order of the log, and whether it counts.

    A decision holds until the next one on its component, or until that is maintained.

    >>> when = {"clock": "run", "at": 9.0}
    >>> late = Event(0, 0, "postponed", "pump", "no spare part", when)
    >>> [one.state for one in labels([late, Event(0, 0, "withdrawn", "pump", "came")], "run")]
    ['withdrawn']
    """
    found: list[Label] = []
    for event in events:
        if event.kind == WITHDRAWN:
            last = newest(found, event.signal)
            if last is not None:
                found[last] = found[last]._replace(state="withdrawn")
        elif event.kind in (*DECISIONS, MAINTAINED):
            problem = _problem(event)
            other = event.evidence.get("clock") != clock
            state: State = "unreadable" if problem else "other clock" if other else "holds"
            found.append(Label(event, state, problem))
    later: set[str] = set()
    for k in reversed(range(len(found))):
        event, state, _ = found[k]
        if state == "holds":
            if event.kind != MAINTAINED and event.signal in later:
                found[k] = found[k]._replace(state="superseded")
            later.add(event.signal)
    return tuple(found)


def newest(found: Sequence[Label], component: str) -> int | None:
    """Place of the newest label on a component that was not withdrawn."""
    for k in reversed(range(len(found))):
        if found[k].event.signal == component and found[k].state != "withdrawn":
            return k
    return None


def standing(found: Sequence[Label]) -> tuple[Event, ...]:
    """Those that count."""
    return tuple(one.event for one in found if one.state == "holds")


def notes(found: Sequence[Label], clock: str) -> tuple[str, ...]:
    """On what does not count, though nobody took it back."""
    told = []
    for one in found:
        said = f"{one.event.signal}: {one.verdict} ({one.event.reason})"
        if one.state == "unreadable":
            told.append(
                f"{said} was left out, {one.problem}: take it back with 'evertwin decide … "
                f"{one.event.signal} withdraw'"
            )
        if one.state == "other clock":
            other = one.event.evidence.get("clock")
            told.append(f"{said} was left out: it is kept on the clock {other}, not {clock}")
    return tuple(told)


def _problem(event: Event) -> str:
    """Why a label cannot be read; empty: it can."""
    evidence: Any = event.evidence
    at = evidence.get("at")
    if not isinstance(at, int | float) or isinstance(at, bool) or not math.isfinite(at):
        return "its time is no number"
    if not isinstance(evidence.get("clock"), str):
        return "it names no clock"
    if event.kind == MAINTAINED and evidence.get("kind") not in DONE:
        return f"it says neither of {', '.join(DONE)}"
    return ""
