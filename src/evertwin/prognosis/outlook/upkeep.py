"""Plan and labels: what the planner and the operator add to the lives.

A plan is computed anew from the lives at every look; what the operator said to a date (confirmed,
postponed, declined, each with a reason) is kept as a label in the store's log and holds until the
component is maintained. Maintenance done is a mark there too, from which a new life begins. The
newest label of a component can be withdrawn; it stays in the log.

Times that are said are counted from now: from the newest value of the component's indicator. They
are kept as moments on the clock of the prognosis, with the moment at which they were said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

from evertwin.errors import UsageError
from evertwin.fold import Event
from evertwin.prognosis.histories.observed_series import component_of
from evertwin.prognosis.histories.parameter_history import DECISIONS, DONE, newest
from evertwin.prognosis.laws import Life
from evertwin.prognosis.laws.plans.planning import OPEN, Decision, Part, Plan, planned
from evertwin.prognosis.laws.plans.renewal import Cost, Windows
from evertwin.prognosis.outlook.lives import Lives
from evertwin.prognosis.outlook.prospect import Prospect

Verdict = Literal["confirmed", "postponed", "declined", "withdrawn"]


def plan(prospect: Prospect, lives: Lives) -> Plan:
    """The cheapest date of every component that has costs, with the operator's decisions.

    Raises:
        UsageError: no component has costs.
    """
    return _plan(prospect, lives, _decisions(prospect, lives))


def _plan(prospect: Prospect, lives: Lives, said: Mapping[str, Decision]) -> Plan:
    rule, costs = prospect.rule, prospect.rule.components
    known: dict[str, Part] = {}
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
            paid = Cost(cost.failure, cost.maintenance)
            known[name] = Part(one.life, age, paid, said.get(name, OPEN))
    if not any(cost.failure is not None for cost in costs.values()):
        raise UsageError(
            "plan: expected failure and maintenance costs of a component, as in "
            "[prognosis.components.gearbox1] failure = 8000, maintenance = 900"
        )
    windows = None if rule.windows is None else Windows(rule.window, rule.windows)
    items, stops = planned(known, windows, rule.visit)
    return Plan(
        lives.name, lives.clock, items, without, stops, prospect.history.notes,
        now=lives.now, calendar=lives.calendar,
    )  # fmt: skip


def _decisions(prospect: Prospect, lives: Lives) -> dict[str, Decision]:
    """What holds for each component, in time from its now."""
    found: dict[str, Decision] = {}
    for event in prospect.history.events:
        one = lives.components.get(event.signal)
        if event.kind in DECISIONS and one is not None and isinstance(one.life, Life):
            evidence: Any = event.evidence
            verdict: Any = event.kind
            until = float(evidence["at"]) - one.life.now
            found[event.signal] = Decision(verdict, event.reason, until)
    return found


def label(
    prospect: Prospect, component: str, verdict: Verdict, reason: str, after: float | None
) -> Event:
    """The operator's word on a planned date, to be kept.

    Args:
        prospect: the twin's.
        component: whose date.
        verdict: what is said; ``withdrawn``: the newest label of the component no longer counts.
        reason: why; must not be empty.
        after: postponed until, or confirmed for, this time from now; None: the planned date.

    Raises:
        UsageError: no such component in the plan, no reason, or a date that cannot be.
    """
    if not reason.strip():
        raise UsageError(f"{verdict}: expected a reason: it is kept with the decision")
    if verdict in ("declined", "withdrawn") and after is not None:
        raise UsageError(f"{verdict}: expected no time, got {after:g}")
    if after is not None and not (math.isfinite(after) and after >= 0.0):
        raise UsageError(
            f"{verdict}: expected a time from now of 0 or more on the plan's clock "
            f"({prospect.rule.clock}), got {after:g}"
        )
    if verdict == "withdrawn":
        return _withdrawal(prospect, component, reason)
    lives = prospect.lives()
    said = _decisions(prospect, lives)
    dates = {one.component: one.after for one in _plan(prospect, lives, said).items}
    if component not in dates:
        raise UsageError(
            f"no planned date of {component!r}; there are {', '.join(sorted(dates)) or 'none'}"
        )
    if verdict == "postponed":
        said.pop(component, None)
        unsaid = {one.component: one.after for one in _plan(prospect, lives, said).items}
        _check_postponed(component, unsaid[component], after, prospect.rule.clock)
    date = dates[component] if after is None else after
    if math.isinf(date):
        raise UsageError(f"{component} is planned to run to failure: give the date to {verdict}")
    life: Any = lives.components[component].life
    return _event(prospect, verdict, component, reason, {
        "at": life.now + date, "now": life.now,
        "planned_after": dates[component] if math.isfinite(dates[component]) else None,
    })  # fmt: skip


def when_said(prospect: Prospect, text: str, *, itself: bool) -> float:
    """A time that somebody says: a number, or a date where the clock has dates.

    Args:
        prospect: the twin's.
        text: what is said.
        itself: the moment is meant; else the time from now.

    Raises:
        UsageError: it is neither.
    """
    try:
        return float(text)
    except ValueError:
        pass
    calendar = prospect.calendar
    try:
        at = math.nan if calendar is None else calendar.at(text)
    except ValueError:
        at = math.nan
    if math.isnan(at):
        or_date = "" if calendar is None else " or a date as in 2027-03-01"
        raise UsageError(
            f"--when: expected a number on the clock {prospect.rule.clock!r}{or_date}, got {text!r}"
        )
    return at if itself else at - prospect.now


def _check_postponed(component: str, planned_after: float, after: float | None, unit: str) -> None:
    if after is None:
        raise UsageError("postponed: expected until when, as a time from now on the plan's clock")
    if math.isinf(planned_after):
        raise UsageError(f"{component} is planned to run to failure: there is no date to postpone")
    if after <= planned_after:
        raise UsageError(
            f"postponed: {component} is planned after {planned_after:.6g} {unit} from now: "
            f"expected a later time, got {after:g}; for an earlier date confirm it"
        )


def _withdrawal(prospect: Prospect, component: str, reason: str) -> Event:
    found = prospect.history.labels
    last = newest(found, component)
    if last is None:
        named = sorted({one.event.signal for one in found if one.state != "withdrawn"})
        raise UsageError(
            f"withdraw: nothing was said or done to {component!r}; labels that stand are of "
            f"{', '.join(named) or 'none'}"
        )
    taken = found[last]
    return _event(prospect, "withdrawn", component, reason, {
        "now": prospect.history.now, "of": taken.verdict, "said": taken.event.reason,
    })  # fmt: skip


def maintenance(
    prospect: Prospect, component: str, reason: str, kind: str, at: float | None
) -> Event:
    """Maintenance that was done, to be kept: a new life, or a shifted level, begins there.

    Args:
        prospect: the twin's.
        component: what was maintained.
        reason: what was done.
        kind: ``replaced``, ``adjusted`` or ``failed``.
        at: when, on the clock of the prognosis; None: now, after the newest value.

    Raises:
        UsageError: no indicator tells of the component, another kind, or a time before the first
            value or later than the next one.
    """
    if component not in prospect.parts:
        known = ", ".join(sorted(set(prospect.parts)))
        raise UsageError(f"maintenance: no component {component!r}: there are {known}")
    if kind not in DONE:
        raise UsageError(f"maintenance: expected one of {', '.join(DONE)}, got {kind!r}")
    first, now = _span(prospect, component)
    between = prospect.history.between
    if at is not None:
        # a later mark would hide the values that come before it
        latest = now + (1.0 if prospect.history.counts else max(now - first, between))
        if not first <= at <= latest:
            told, unit = prospect.calendar, f" {prospect.rule.clock}"
            begin, end, got = (
                f"{x:g}" if told is None else told.said(x) for x in (first, latest, at)
            )
            raise UsageError(
                f"maintenance: expected when it was done, on the clock of the prognosis: {begin} "
                f"(first value) to {end}{unit if told is None else ''}, got {got}; without a time "
                "it is now"
            )
    when = now + between if at is None else at
    more = {"at": when, "kind": kind, "now": now}
    return _event(prospect, "maintained", component, reason or kind, more)


def _span(prospect: Prospect, component: str) -> tuple[float, float]:
    """First and newest value that tell of a component."""
    found = [
        prospect.observed(rule).at
        for rule in prospect.basis.setup.spec.indicator
        if component_of(rule) == component
    ]
    known = [at for at in found if len(at)]
    now = prospect.history.now if prospect.table is None else 0.0
    first = min((float(at[0]) for at in known), default=now)
    return first, max([float(at[-1]) for at in known] + [now])


def _event(
    prospect: Prospect, kind: str, component: str, reason: str, evidence: Mapping[str, Any]
) -> Event:
    """A label, at the stamp of the newest row that is known."""
    clock: dict[str, Any] = {"clock": prospect.rule.clock}
    told = prospect.calendar if "at" in evidence else None
    if told is not None:
        moments = ((name, evidence.get(name)) for name in ("at", "now"))
        clock["dates"] = {name: told.iso(x) for name, x in moments if x is not None}
    return Event(0, prospect.history.stamp, kind, component, reason, clock | dict(evidence))
