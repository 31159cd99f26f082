"""Alarms through the log: raised once, again when they return, and within the day's budget.

A day is 24 h by the recordings' stamps. Where each recording begins at zero nobody knows which day
it is; then each run counts as a day: time in tasks would make a day of thousands of short runs, and
hold alarms back for as long. No clock of the computer is asked, so the log stays reproducible.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from evertwin.config.prognosis import PrognosisSpec
from evertwin.fold import Event
from evertwin.prognosis.laws.alarms import RELEASE, Kind, alarm_of, has_cleared, within_budget
from evertwin.prognosis.lives import Lives
from evertwin.prognosis.parameter_history import dated, history
from evertwin.store import Store


class Day(NamedTuple):
    """The present day.

    >>> Day(3.0, "runs", 0).by
    'runs'
    """

    number: float
    by: str
    """``stamps`` or ``runs``."""
    stamp: int
    """Of the newest row [ns]."""


def alarmed(store: Store, lives: Lives, rule: PrognosisSpec) -> tuple[Lives, tuple[Event, ...]]:
    """The lives with the alarms that the day's budget allows, and what is to be kept of them.

    Args:
        store: the twin's.
        lives: with the alarms that are due.
        rule: time ahead, accepted risk and budget.
    """
    today = _today(store)
    active: dict[tuple[str, Kind], None] = {}
    raised = []
    for event in (e for e in store.read("event") if isinstance(e, Event)):
        evidence: Any = event.evidence
        if event.kind == "alarm":
            active[event.signal, evidence["kind"]] = None
            if evidence.get("by") == today.by:
                raised.append((str(evidence["kind"]), float(evidence["day"])))
        elif event.kind == "alarm_cleared":
            active.pop((event.signal, evidence["kind"]), None)
        elif event.kind == "maintained":
            active = {key: None for key in active if key[0] != event.signal}
    cleared = [key for key in active if _is_clear(key, lives, rule)]
    stands = [key for key in active if key not in cleared]
    spent = within_budget(lives.alarms, stands, raised, today.number, rule.alarms)
    held = {(a.component, a.kind) for a in spent.held}
    shown = tuple(a for a in lives.alarms if (a.component, a.kind) not in held)
    events = [
        Event(0, today.stamp, "alarm_cleared", component, f"{kind}: no longer so", {"kind": kind})
        for component, kind in cleared
    ] + [
        Event(
            0, today.stamp, "alarm", alarm.component, alarm.reason,
            {"kind": alarm.kind, "day": today.number, "by": today.by, "action": alarm.action,
             "interval80": alarm.interval, **alarm.evidence},
        )
        for alarm in spent.raised
    ]  # fmt: skip
    return replace(lives, alarms=shown, held=spent.held, alarms_today=spent.today), tuple(events)


def _today(store: Store) -> Day:
    by_stamps = dated(store)
    known = history(store, "d" if by_stamps else "run")
    return Day(known.now, "stamps" if by_stamps else "runs", known.stamp)


def _is_clear(key: tuple[str, Kind], lives: Lives, rule: PrognosisSpec) -> bool:
    component, kind = key
    one = lives.components.get(component)
    if one is None:
        return False  # no longer looked at
    stands = alarm_of(component, one.indicator, one.life, rule.ahead, RELEASE * rule.risk)
    return has_cleared(kind, one.life, stands)
