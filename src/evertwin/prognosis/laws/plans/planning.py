"""The maintenance plan: dates of all components, chosen together, with what the operator said.

Each component has a date of least cost per time of use (`renewal`). Where a
stop costs something whatever is done in it, components whose dates lie close are done in one stop
(`grouping`). What the operator said binds: a confirmed date is fixed, a
postponed one is sought no earlier, a declined one shares no stop. Probability and cost are those of
the date that results.

>>> from evertwin.prognosis.laws.series.life import LEVELS
>>> life = Life.of("h", LEVELS, 80.0 + 40.0 * LEVELS)
>>> part = Part(life, age=400.0, cost=Cost(10_000.0, 1_000.0))
>>> (item,), _ = planned({"gearbox": part})
>>> 79.0 < item.after < 90.0, item.probability < 0.2
(True, True)
>>> _, stops = planned({"gearbox": part, "motor": part}, visit=200.0)
>>> stops[0].components, round(stops[0].saving)
(('gearbox', 'motor'), 200)
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from evertwin.errors import naming
from evertwin.fold import plain
from evertwin.prognosis.laws.plans.grouping import Group, Member, together
from evertwin.prognosis.laws.plans.renewal import Cost, Renewal, Windows
from evertwin.prognosis.laws.series.calendar import Calendar
from evertwin.prognosis.laws.series.life import Life
from evertwin.types import Json

HEADINGS = (
    "component", "after", "unit", "window", "probability_before", "cost_rate",
    "cost_rate_run_to_failure", "median_life", "decision", "reason", "stop", "stop_saving", "note",
    "date",
)  # fmt: skip
LATE = 0.5
"""A date is too late if a failure before it is likelier than this."""


class Decision(NamedTuple):
    """What the operator says to a planned date.

    >>> Decision("postponed", "spare part late", 40.0).until
    40.0
    """

    verdict: Literal["open", "confirmed", "postponed", "declined"]
    reason: str = ""
    until: float = 0.0
    """Not before this time from now (postponed), or at this time (confirmed); may have passed."""


OPEN = Decision("open")


class Part(NamedTuple):
    """A component that is planned for.

    >>> Part._fields
    ('life', 'age', 'cost', 'decision')
    """

    life: Life
    age: float
    """Time in use so far, in the life's unit."""
    cost: Cost
    decision: Decision = OPEN
    """What the operator said."""


@dataclass(frozen=True)
class PlanItem:
    """One component's date.

    >>> PlanItem("pump", "h", 10.0, 0.01, 2.0, 3.0, 50.0).decision.verdict
    'open'
    """

    component: str
    unit: str
    after: float
    """Time from now; infinite: run to failure."""
    probability: float
    """That it fails before."""
    rate: float
    """Cost per time of use with this date, its share of the stop included; infinite where life was
    over before any use."""
    rate_to_failure: float
    """Cost per time of use without any maintenance in time. What may never end is counted as
    failing at the last quantile known, so that it may be less."""
    median: float
    """Of the remaining life."""
    window: int | None = None
    """Number of the maintenance window from now, 0 the next one."""
    decision: Decision = OPEN
    note: str = ""
    """What is wrong with the date."""


class Stop(NamedTuple):
    """One stop of the machine, and what is done in it.

    >>> Stop(20.0, ("pump",)).saving
    0.0
    """

    after: float
    components: tuple[str, ...]
    window: int | None = None
    saving: float = 0.0
    """Cost that is saved by one stop for all, on the mean: against the best dates with a stop for
    each."""


@dataclass(frozen=True)
class Plan:
    """Every component's date, the earliest first.

    >>> Plan("press", "h", ()).to_csv().splitlines()[0][:15]
    'component,after'
    """

    name: str
    unit: str
    items: tuple[PlanItem, ...]
    without: Mapping[str, str] = field(default_factory=dict)
    """Components without a date, and why."""
    stops: tuple[Stop, ...] = ()
    """In the order of their dates."""
    notes: tuple[str, ...] = ()
    """What may surprise."""
    now: float = 0.0
    """The moment that dates are counted from, on the clock."""
    calendar: Calendar | None = None
    """Where the clock counts from 1970."""

    def date(self, after: float) -> str:
        """A date of the plan as a date; empty where the clock tells none, or there is none."""
        if self.calendar is None or not np.isfinite(after):
            return ""
        return self.calendar.said(self.now + after)

    def gone(self, after: float) -> bool:
        """Does a date of the plan lie before today?"""
        return self.calendar is not None and self.calendar.gone(self.now + after)

    @property
    def saving(self) -> float:
        """What common stops save in all."""
        return sum(stop.saving for stop in self.stops)

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.plan/1"``."""
        content: Any = {
            "schema": "evertwin.plan/1", "name": self.name, "unit": self.unit,
            "items": [
                {**self._row(one), "date": self.date(one.after) or None,
                 "past": self.gone(one.after)} for one in self.items
            ],
            "stops": [stop._asdict() for stop in self.stops], "saving": self.saving,
            "without_date": self.without, "notes": self.notes,
        }  # fmt: skip
        return plain(content)  # type: ignore[return-value]

    @staticmethod
    def _row(one: PlanItem) -> dict[str, Any]:
        return {
            "component": one.component, "after": one.after, "window": one.window,
            "probability_before": one.probability, "cost_rate": one.rate,
            "cost_rate_run_to_failure": one.rate_to_failure, "median_life": one.median,
            "decision": one.decision.verdict, "reason": one.decision.reason, "note": one.note,
        }  # fmt: skip

    def to_csv(self) -> str:
        """One line per component; an infinite date is an empty cell."""
        out = io.StringIO()
        writer = csv.DictWriter(out, HEADINGS, restval="", lineterminator="\n")
        writer.writeheader()
        stops = {
            name: {"stop": k, "stop_saving": stop.saving}
            for k, stop in enumerate(self.stops, 1) for name in stop.components
        }  # fmt: skip
        for one in self.items:
            row = self._row(one) | {"unit": one.unit, **stops.get(one.component, {})}
            cells = {name: _cell(value) for name, value in row.items()}
            writer.writerow(cells | {"date": self.date(one.after)})
        return out.getvalue()


def _cell(value: object) -> object:
    """A number to six digits, if it is finite; a text that a spreadsheet takes for no formula."""
    if isinstance(value, float):
        return f"{value:.6g}" if np.isfinite(value) else ""
    risky = isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r")
    return f"'{value}" if risky else value


def planned(
    parts: Mapping[str, Part], windows: Windows | None = None, visit: float = 0.0
) -> tuple[tuple[PlanItem, ...], tuple[Stop, ...]]:
    """Dates of several components and their stops, the earliest first.

    Args:
        parts: component → remaining life, age, cost, and what the operator said.
        windows: possible dates; None: any time.
        visit: cost of one stop, whatever is done in it.

    Raises:
        UsageError: a negative age or cost.
    """
    members: dict[str, Member] = {}
    items = []
    for name, part in parts.items():
        if np.isfinite(part.life.remaining[0]):
            members[name] = _member(name, part, windows, visit)
        else:
            items.append(PlanItem(name, part.life.unit, np.inf, 0.0, 0.0, 0.0, np.inf,
                                  decision=part.decision))  # fmt: skip
    apart = [n for n in members if parts[n].decision.verdict == "declined"]
    groups = together([one for n, one in members.items() if n not in apart], windows, visit)
    lonely = [group for n in apart for group in together((members[n],), windows, visit)]
    for group in (*groups, *lonely):
        for name in group.names:
            share = _share(group, members, visit)
            items.append(_item(members[name], parts[name], group.after, share, windows))
    stops = tuple(
        Stop(group.after, group.names, _window(windows, group.after), group.saving)
        for group in groups if np.isfinite(group.after)
    )  # fmt: skip
    return tuple(sorted(items, key=lambda one: (one.after, one.component))), stops


def _member(name: str, part: Part, windows: Windows | None, visit: float) -> Member:
    decision = part.decision
    with naming(f"plan of {name}"):
        paid = Cost(part.cost.failure, part.cost.maintenance + visit)
        renewal = Renewal.of(part.life.wearing, part.age, paid)
    own, rate = renewal.best(windows)
    earliest, exact = 0.0, None
    if decision.verdict == "postponed":
        earliest = max(decision.until, 0.0)
    if decision.verdict == "confirmed":
        exact = max(decision.until, 0.0)
    elif renewal.over and earliest <= own:
        exact = own  # nothing is gained by waiting
    if decision.verdict == "postponed" and not np.isfinite(own) and earliest > 0.0:
        own = earliest if windows is None else float(windows.near(np.array([earliest]))[-1])
    return Member(name, renewal, own, rate, earliest, exact)


def _share(group: Group, members: Mapping[str, Member], visit: float) -> float:
    """A component's share of the cost of its stop, if it lasts until then."""
    if visit == 0.0 or not np.isfinite(group.after):
        return 0.0
    at = np.array([group.after])
    failed = [float(members[n].renewal.failure(at)[0]) for n in group.names]
    lasting = sum(1.0 - p for p in failed)
    return visit * (1.0 - float(np.prod(failed))) / lasting if lasting > 0.0 else 0.0


def _item(
    member: Member, part: Part, after: float, share: float, windows: Windows | None
) -> PlanItem:
    renewal = member.renewal
    rate = renewal.to_failure
    if np.isfinite(after):
        paid = Cost(part.cost.failure, part.cost.maintenance + share)
        rate = float(replace(renewal, cost=paid).rate(np.array([after]))[0])
    return PlanItem(
        member.name, part.life.unit, after, renewal.probability(after), rate, renewal.to_failure,
        part.life.median, _window(windows, after),
        part.decision, _note(renewal, after, windows, part),
    )  # fmt: skip


def _window(windows: Windows | None, after: float) -> int | None:
    return None if windows is None or not np.isfinite(after) else windows.number(after)


def _note(renewal: Renewal, after: float, windows: Windows | None, part: Part) -> str:
    decision, unit = part.decision, part.life.unit
    if decision.verdict == "confirmed" and decision.until < 0.0:
        return f"the confirmed date passed {-decision.until:.4g} {unit} ago"
    if renewal.over:
        return "its life is over"
    chance = renewal.probability(after)
    if decision.verdict in ("confirmed", "postponed") and chance > LATE:
        return f"a failure before the {decision.verdict} date is likely ({chance:.0%})"
    free = renewal.best()[0]
    late = not np.isfinite(after) or chance > LATE
    if windows is not None and np.isfinite(free) and late and windows.first > free:
        return (
            f"no window comes in time: the first is in {windows.first:.4g} {unit}, half the lives "
            f"end within {part.life.median:.4g}; at any time it would be after {free:.4g} {unit}"
        )
    return ""
