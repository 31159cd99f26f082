"""Alarms: few, and each with its reason, interval, evidence and action.

An alarm is due when the limit is passed, when a failure within the time ahead is likelier than the
accepted risk, or when wear has begun where nothing else can be said yet. Who is asked to act within
that time is not told so where more than `FAR` times as much is likelier still: a life that is known
that badly is no date, and the risk that is accepted rises with it. Like machines tell no such
failure of one whose own growth does not stand out, unless their lives end at its age. It is raised
once, not at every look, and again when it had cleared and returns; a failure that was due has
cleared when its risk is half of the accepted one, so that a risk that wavers is no flood. A day has
a budget: the most urgent are raised first, the rest is held back, shown and counted. That a limit
is passed is never held back: somebody has to look, also where a sensor would look the same, and
then the alarm says so. What is ahead waits until somebody says which it is.

>>> from evertwin.prognosis.laws.series.indicator import Indicator, Limit
>>> from evertwin.prognosis.laws.series.life import LEVELS, Life
>>> friction = Indicator.of("friction", "Nm", Limit(3.0), [0, 1], [1.0, 2.0])
>>> due = alarm_of("gearbox", friction, Life.of("h", LEVELS, 10 * LEVELS), ahead=5.0, risk=0.1)
>>> due.kind, due.action
('failure_due', 'plan maintenance of gearbox within 0.5 h')
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.prognosis.laws.series.life import Life, NotEnough
from evertwin.types import Json

Kind = Literal["limit_passed", "failure_due", "wear_begun"]
URGENCY: Mapping[str, int] = {"limit_passed": 0, "failure_due": 1, "wear_begun": 2}
UNHELD: Kind = "limit_passed"
"""Raised whatever the budget says."""
LEAD = 0.1
"""Share of the whole life within which a failure has to be foreseen."""
RELEASE = 0.5
"""Share of the accepted risk below which a failure is no longer due."""
FAR, EVEN = 5.0, 0.1
"""Times of the time ahead that are far too early for an alarm, and the chance that so much is left
beyond which the accepted risk rises in its ratio: of a risk of 0.1 the failure has to be likelier
within the time ahead than beyond `FAR` times as much."""


@dataclass(frozen=True)
class Alarm:
    """Something that a planner has to know now.

    >>> Alarm("pump", "wear_begun", "wear began", (None, None), "look at it").evidence
    {}
    """

    component: str
    kind: Kind
    reason: str
    """One sentence with its figures."""
    interval: tuple[float | None, float | None]
    """80 % interval of the remaining life; None: not known, or without end."""
    action: str
    evidence: Mapping[str, Json] = field(default_factory=dict)


class Spent(NamedTuple):
    """What the budget allows.

    >>> Spent((), (), 0).today
    0
    """

    raised: tuple[Alarm, ...]
    held: tuple[Alarm, ...]
    """Over budget: shown, not raised."""
    today: int
    """Alarms of the last day, these included."""


def alarm_of(
    component: str, indicator: Indicator, life: Life | NotEnough, ahead: float | None, risk: float,
    alike: Sequence[str] = (),
) -> Alarm | None:  # fmt: skip
    """The alarm that is due for a component, if any.

    Args:
        component: its name.
        indicator: what tells its wear.
        life: what is known of its remaining life.
        ahead: time within which a failure has to be foreseen, in the indicator's clock; None:
            `LEAD` of the whole life.
        risk: probability of failure that is not accepted.
        alike: what would look the same as its wear.
    """
    known = indicator.value[np.isfinite(indicator.value)]
    value = float(known[-1]) if len(known) else float("nan")
    evidence: dict[str, Json] = {
        "indicator": indicator.name, "value": value, "unit": indicator.unit,
        "limit": indicator.limit.value, "limit_source": indicator.limit.source,
    }  # fmt: skip
    limit = indicator.shown(indicator.limit.value)
    shown = f"{indicator.name} is {indicator.shown(value)}, limit {limit}"
    if alike and (isinstance(life, NotEnough) or life.median > 0.0):
        return None
    if isinstance(life, NotEnough):
        if life.onset is None:
            return None
        reason = (
            f"wear began at {indicator.moment(life.onset.begin)}, told at "
            f"{indicator.moment(life.onset.told)}; {shown}"
        )
        evidence |= {"onset": life.onset.begin, "told": life.onset.told}
        action = f"look at {component}; measure more often: {life.needs}"
        return Alarm(component, "wear_begun", reason, (None, None), action, evidence)
    low, high = life.interval80
    interval = (low, high if np.isfinite(high) else None)
    ahead = lead(indicator, life, LEAD) if ahead is None else ahead
    wears = life.wearing  # of ends that nothing foretells none is told
    chance = wears.risk_before(ahead)
    evidence |= {"probability": chance, "ahead": ahead, "law": life.law, "median": life.median}
    if life.median <= 0.0:
        reason = f"{shown}: {'it has failed' if life.failed else 'the limit is passed'}"
        action = f"maintain {component} now"
        if alike:
            reason, evidence = "; ".join((reason, *alike)), evidence | {"doubt": [*alike]}
            action = (
                f"look at {component} and at its sensor now; then say which it is: evertwin label "
                "… true (the machine) or false alarm (the sensor)"
            )
        return Alarm(component, "limit_passed", reason, interval, action, evidence)
    if chance > accepted(wears, ahead, risk):
        until = f"{high:.3g}" if np.isfinite(high) else "without end"
        reason = (
            f"{shown}; it lasts {low:.3g} to {until} {life.unit} (80 %), fails within {ahead:.4g} "
            f"{life.unit} with probability {chance:.2f}"
        )
        action = f"plan maintenance of {component} within {wears.not_before:.3g} {life.unit}"
        if life.calendar is not None:
            action += f", by {life.calendar.said(life.now + wears.not_before)}"
        return Alarm(component, "failure_due", reason, interval, action, evidence)
    return None


def accepted(life: Life, ahead: float, risk: float) -> float:
    """The risk that is accepted of a life that may be far longer than the time ahead.

    >>> sure, open_ended = (Life.of("h", [0.1, 0.9], [8.0, last]) for last in (30.0, 300.0))
    >>> [round(accepted(one, 10.0, 0.1), 2) for one in (sure, open_ended)]
    [0.1, 0.78]
    """
    return risk * max((1.0 - life.probability_before(FAR * ahead)) / EVEN, 1.0)


def lead(indicator: Indicator, life: Life, share: float) -> float:
    """A share of the whole life: of its age, and of what is left where that is known."""
    own = indicator.since_replaced()
    start = own.origin if own.origin is not None else float(own.at[0])
    left = life.median if np.isfinite(life.median) else 0.0
    return share * (float(own.at[-1]) - start + left)


def within_budget(
    due: Sequence[Alarm], active: Sequence[tuple[str, str]], raised: Sequence[tuple[str, float]],
    now: float, budget: float,
) -> Spent:  # fmt: skip
    """Which of the alarms that are due are raised.

    Args:
        due: alarms that are due.
        active: (component, kind) of alarms that were raised and still stand: not raised again.
        raised: (kind, day) of the alarms raised so far.
        now: the present day.
        budget: alarms per day. That a limit is passed is always raised, and not counted.
    """
    new = [a for a in due if (a.component, a.kind) not in set(active)]
    new.sort(key=lambda a: (URGENCY[a.kind], a.component))
    always = [a for a in new if a.kind == UNHELD]
    rest = [a for a in new if a.kind != UNHELD]
    counted = [day for kind, day in raised if kind != UNHELD]
    before = sum(1 for day in counted if now - 1.0 < day <= now)
    room = max(int(budget) - before, 0) if budget >= 1.0 else int(_rare(counted, now, budget))
    told = (*always, *rest[:room])
    today = sum(1 for _, day in raised if now - 1.0 < day <= now) + len(told)
    return Spent(told, tuple(rest[room:]), today)


def _rare(raised: Sequence[float], now: float, budget: float) -> bool:
    """A budget below one a day: one alarm in 1 / budget days."""
    return not any(now - 1.0 / budget < day <= now for day in raised)


def has_cleared(kind: Kind, life: Life | NotEnough, stands: Alarm | None) -> bool:
    """Is what an alarm told no longer so? What is not known has not cleared.

    Args:
        kind: of the alarm that was raised.
        life: what is known now.
        stands: the alarm that would still stand now, by `RELEASE` of the risk.

    >>> known = Life.of("h", [0.5], [100.0])
    >>> has_cleared("failure_due", known, None)
    True
    >>> has_cleared("failure_due", NotEnough("six values"), None)
    False
    """
    if stands is not None and URGENCY[stands.kind] <= URGENCY[kind]:
        return False
    if kind == "wear_begun":
        return isinstance(life, NotEnough) and life.onset is None
    return isinstance(life, Life)
