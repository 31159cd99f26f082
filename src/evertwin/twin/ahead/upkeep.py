"""Plan, labels and alarms in the store: what the planner and the operator add to the lives.

A plan is computed anew from the lives at every look; what the operator said to a date (confirmed,
postponed, declined, each with a reason) is kept as a label in the store's log and holds until the
component is maintained. Maintenance done is a mark there too, from which a new life begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from evertwin.errors import UsageError
from evertwin.fold import Event
from evertwin.prognosis import Life
from evertwin.prognosis.alarms import within_budget
from evertwin.prognosis.planning import Cost, Decision, Plan, decided, grouped
from evertwin.store import Store
from evertwin.twin.ahead.history import history
from evertwin.twin.ahead.lives import Lives, Prospect

__all__ = ["VERDICTS", "Verdict", "alarmed", "label", "maintenance", "plan"]

Verdict = Literal["confirmed", "postponed", "declined"]
VERDICTS = ("confirmed", "postponed", "declined")
DAY = 86400.0


def plan(prospect: Prospect, lives: Lives) -> Plan:
    """The cheapest date of every component that has costs, with the operator's decisions.

    Raises:
        UsageError: no component has costs.
    """
    costs = prospect.rule.components
    known: dict[str, tuple[Life, float, Cost]] = {}
    without = {}
    for name, one in lives.components.items():
        cost = costs.get(name)
        if cost is None or cost.failure is None or cost.maintenance is None:
            without[name] = "no cost of failure and maintenance under [prognosis.components]"
        elif not isinstance(one.life, Life):
            without[name] = one.sentence
        else:
            # an age in the past's clock, in time of the work ahead
            age = one.age / one.rate if one.rate > 0.0 else one.age
            known[name] = (one.life, age, Cost(cost.failure, cost.maintenance))
    if not known and not any("cost" not in reason for reason in without.values()):
        raise UsageError(
            "plan: expected failure and maintenance costs of a component, as in "
            "[prognosis.components.gearbox1] failure = 8000, maintenance = 900"
        )
    items = grouped(known, prospect.rule.windows, prospect.rule.window)
    found = prospect.history
    said = _decisions(found.events, found.now, prospect.rule.clock)
    return Plan(lives.name, lives.clock, decided(items, said), without)


def _decisions(events: Sequence[Event], now: float, clock: str) -> Mapping[str, Decision]:
    """The newest decision on each component since its last maintenance."""
    found: dict[str, Decision] = {}
    for event in events:
        evidence: Any = event.evidence
        if event.kind == "maintained":
            found.pop(event.signal, None)
        elif event.kind in VERDICTS and evidence["clock"] == clock:
            verdict: Any = event.kind
            found[event.signal] = Decision(verdict, event.reason, float(evidence["at"]) - now)
    return found


def label(
    prospect: Prospect, component: str, verdict: Verdict, reason: str, after: float | None
) -> Event:
    """The operator's word on a planned date, to be kept.

    Args:
        prospect: the twin's.
        component: whose date.
        verdict: what is said.
        reason: why; must not be empty.
        after: postponed until, or confirmed for, this time from now; None: the planned date.

    Raises:
        UsageError: no such component in the plan, no reason, or a date to postpone to is missing.
    """
    if not reason.strip():
        raise UsageError(f"{verdict}: expected a reason: it is kept with the decision")
    dates = {one.component: one.after for one in plan(prospect, prospect.lives()).items}
    if component not in dates:
        raise UsageError(
            f"no planned date of {component!r}; there are {', '.join(sorted(dates)) or 'none'}"
        )
    if verdict == "postponed" and after is None:
        raise UsageError("postponed: expected until when, as a time from now on the plan's clock")
    at = prospect.history.now + (dates[component] if after is None else after)
    if at == float("inf"):
        raise UsageError(f"{component} is planned to run to failure: give the date to {verdict}")
    evidence = {"clock": prospect.rule.clock, "at": at, "planned_after": dates[component]}
    return Event(0, 0, verdict, component, reason, evidence)


def maintenance(
    prospect: Prospect, component: str, reason: str, kind: str, at: float | None
) -> Event:
    """Maintenance that was done, to be kept: a new life, or a shifted level, begins there.

    Args:
        prospect: the twin's.
        component: what was maintained.
        reason: what was done.
        kind: ``replaced`` or ``adjusted``.
        at: when, on the clock of the prognosis; None: now, after the newest value.

    Raises:
        UsageError: no indicator tells of the component, or another kind.
    """
    known = sorted({r.component or r.name for r in prospect.basis.setup.spec.indicator})
    if component not in known:
        raise UsageError(f"maintenance: no component {component!r}: there are {', '.join(known)}")
    if kind not in ("replaced", "adjusted"):
        raise UsageError(f"maintenance: expected 'replaced' or 'adjusted', got {kind!r}")
    when = prospect.history.after if at is None else at
    evidence = {"clock": prospect.rule.clock, "at": when, "kind": kind}
    return Event(0, 0, "maintained", component, reason or kind, evidence)


def alarmed(store: Store, lives: Lives, budget: float) -> tuple[Lives, tuple[Event, ...]]:
    """The lives with the alarms that the day's budget allows, and these as events to be kept."""
    days = history(store, "d")
    now = days.now
    active: dict[tuple[str, str], float] = {}
    raised = []
    for event in (e for e in store.read("event") if isinstance(e, Event)):
        evidence: Any = event.evidence
        if event.kind == "alarm":
            active[event.signal, str(evidence["kind"])] = float(evidence["day"])
            raised.append(float(evidence["day"]))
        elif event.kind == "maintained":
            active = {key: day for key, day in active.items() if key[0] != event.signal}
    spent = within_budget(lives.alarms, tuple(active), raised, now, budget)
    events = tuple(
        Event(
            0, int(now * DAY * 1e9), "alarm", alarm.component, alarm.reason,
            {"kind": alarm.kind, "day": now, "action": alarm.action, "interval80": alarm.interval,
             **alarm.evidence},
        )
        for alarm in spent.raised
    )  # fmt: skip
    held = {(a.component, a.kind) for a in spent.held}
    shown = tuple(a for a in lives.alarms if (a.component, a.kind) not in held)
    return replace(lives, alarms=shown, held=spent.held, alarms_today=spent.today), events
