"""Plans and what was said to them, as documents and as lines on the console."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np

from evertwin.fold import plain
from evertwin.prognosis.histories.parameter_history import Label
from evertwin.prognosis.laws.plans.planning import Plan, PlanItem
from evertwin.types import Json

BEFORE = {"postponed": "until ", "confirmed": "for ", "declined": "the date "}
"""What stands before the moment that was said."""


def plan_text(found: Plan) -> str:
    """One line per component, then the stops that several share."""
    lines = []
    for one in found.items:
        lines.append(_line(one, found.date(one.after)))
        lines += [f"  ! {one.note}"] if one.note else []
    for stop in found.stops:
        if len(stop.components) > 1:
            saved = f", saves {stop.saving:.4g}" if stop.saving > 0.0 else ""
            names = ", ".join(stop.components)
            on = f", {date}" if (date := found.date(stop.after)) else ""
            lines.append(f"one stop after {stop.after:.4g} {found.unit}{on}: {names}{saved}")
    lines += [f"{name}: no date: {why}" for name, why in found.without.items()]
    lines += [f"note: {note}" for note in found.notes]
    return "\n".join(lines)


def _line(one: PlanItem, date: str) -> str:
    when = f"after {one.after:.4g} {one.unit}" if np.isfinite(one.after) else "run to failure"
    when = f"on {date}, {when}" if date else when
    if date and date < f"{datetime.now(UTC):%Y-%m-%d}":
        when += " (in the past: dates count from the newest row)"
    window = "" if one.window is None else f" (window {one.window})"
    cost = "not in use yet, so no cost per time"
    if np.isfinite(one.rate):
        cost = f"cost {one.rate:.4g} a {one.unit} (to failure {one.rate_to_failure:.4g})"
    said = one.decision
    mark = "" if said.verdict == "open" else f"  {said.verdict}: {said.reason}"
    before = "failure" if not np.isfinite(one.after) else "failure before"
    return f"{one.component}: {when}{window}, {before} {one.probability:.3f}, {cost}{mark}"


def label_document(one: Label) -> dict[str, Json]:
    """One entry of ``evertwin.decisions/1``."""
    evidence: Any = one.event.evidence
    content: Any = {
        "component": one.event.signal, "verdict": one.verdict, "state": one.state,
        "reason": one.event.reason, "said_at": evidence.get("now"), "at": evidence.get("at"),
        "clock": evidence.get("clock"), "time": one.event.time or None,
        "dates": evidence.get("dates"),
    }  # fmt: skip
    return plain(content)  # type: ignore[return-value]


def label_text(one: Label) -> str:
    """The same as a line: when it was said, of what, until or for when, and whether it counts."""
    evidence: Any = one.event.evidence
    clock, dates = evidence.get("clock") or "", evidence.get("dates") or {}

    def moment(name: str) -> str:
        """A date to the minute where there is one."""
        date = str(dates.get(name, ""))
        return f"{date[:10]} {date[11:16]}" if date else f"{clock} {evidence[name]:.6g}"

    said = "at ?" if evidence.get("now") is None else f"at {moment('now')}"
    known = isinstance(evidence.get("at"), int | float)
    when = f" {BEFORE.get(one.verdict, '')}{moment('at')}" if known else ""
    state = "" if one.state == "holds" else f"  [{one.state}]"
    return f"{said}: {one.event.signal}: {one.verdict}{when}: {one.event.reason}{state}"
