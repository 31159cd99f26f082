"""Alarms through the log: raised once, again when they return, and within the day's budget.

A day is 24 h by the recordings' stamps. Where each recording begins at zero nobody knows which day
it is; then each run counts as a day: time in tasks would make a day of thousands of short runs, and
hold alarms back for as long. No clock of the computer is asked, so the log stays reproducible.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from evertwin.config.prognosis import PrognosisSpec
from evertwin.fold import Event
from evertwin.prognosis.histories.parameter_history import dated, history
from evertwin.prognosis.laws.plans.alarms import (
    RELEASE,
    UNHELD,
    Alarm,
    Kind,
    alarm_of,
    has_cleared,
    lead,
    within_budget,
)
from evertwin.prognosis.laws.series.life import Life
from evertwin.prognosis.outlook.lives import ComponentLife, Lives
from evertwin.store import Store

LITTLE = 0.05
"""Part of the limit by which a value is worse than that of a false alarm, to alarm again."""


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
    active, mistaken, raised = _kept(store)
    due = tuple(a for a in lives.alarms if not _mistaken(a, lives, mistaken))
    cleared = [key for key, value in active.items() if _is_clear(key, value, lives, rule)]
    stands = [key for key in active if key not in cleared]
    days = [(kind, day) for kind, day, by in raised if by == today.by]
    spent = within_budget(due, stands, days, today.number, rule.alarms)
    shown = tuple(a for a in due if a not in spent.held)
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


def time_ahead(rule: PrognosisSpec, one: ComponentLife) -> float | None:
    """Time on the clock within which a failure has to be foreseen; None: nothing was said."""
    told = rule.lead
    if told is None or not told.share:
        return None if told is None else told.size
    return lead(one.indicator, one.life, told.size) if isinstance(one.life, Life) else None


Key = tuple[str, Kind]


def _kept(store: Store) -> tuple[dict[Key, Any], dict[Key, Any], list[tuple[str, float, str]]]:
    """Of the log: the value that each alarm that stands was raised on; that of each that a person
    called false since the last maintenance; kind and day of all, and what days are counted by."""
    active, mistaken, raised = dict[Key, Any](), dict[Key, Any](), list[tuple[str, float, str]]()
    every = dict[int, Event]()
    for entry in store.entries(kinds=("event",)):
        event = store.record(entry)
        assert isinstance(event, Event)
        evidence: Any = event.evidence
        if event.kind == "alarm":
            every[entry.number] = event
            active[event.signal, evidence["kind"]] = evidence.get("value")
            raised.append((str(evidence["kind"]), float(evidence["day"]), str(evidence.get("by"))))
        elif event.kind == "alarm_cleared":
            active.pop((event.signal, evidence["kind"]), None)
        elif event.kind == "maintained":
            for known in (active, mistaken):
                for key in [key for key in known if key[0] == event.signal]:
                    del known[key]
        elif event.kind == "labelled" and evidence["event"] in every:
            said: Any = every[evidence["event"]]
            key = said.signal, said.evidence["kind"]
            if evidence["verdict"] == "false alarm":
                active.pop(key, None)
                mistaken[key] = said.evidence.get("value")
    return active, mistaken, raised


def called_false(store: Store, component: str) -> tuple[float, ...]:
    """Values of a component that lay beyond the limit by an alarm that a person called false."""
    passed, found = dict[int, float](), list[float]()
    for entry in store.entries(kinds=("event",)):
        event: Any = store.record(entry)
        evidence = event.evidence
        if event.kind == "alarm" and evidence["kind"] == UNHELD and event.signal == component:
            passed[entry.number] = evidence["value"]
        elif event.kind == "labelled" and evidence["verdict"] == "false alarm":
            found += [passed[n] for n in (evidence["event"],) if n in passed]
    return tuple(found)


def _mistaken(alarm: Alarm, lives: Lives, mistaken: Mapping[Key, Any]) -> bool:
    """Did a person call it false, at a value that is hardly better?"""
    said, now = mistaken.get((alarm.component, alarm.kind)), alarm.evidence.get("value")
    if said is None or not isinstance(now, int | float):
        return False
    limit = lives.components[alarm.component].indicator.limit
    return bool(limit.sign * (now - said) <= LITTLE * abs(limit.value))


def _today(store: Store) -> Day:
    by_stamps = dated(store)
    known = history(store, "d" if by_stamps else "run")
    return Day(known.now, "stamps" if by_stamps else "runs", known.stamp)


def _is_clear(key: Key, value: Any, lives: Lives, rule: PrognosisSpec) -> bool:
    component, kind = key
    one = lives.components.get(component)
    if one is None:
        return False  # no longer looked at
    ahead = time_ahead(rule, one)
    stands = alarm_of(component, one.indicator, one.life, ahead, RELEASE * rule.risk)
    left = value is not None and value not in one.indicator.value  # it counts no more
    return (stands is None and left) or has_cleared(kind, one.life, stands)
