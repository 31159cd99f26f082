"""What is known of the lives of a machine's components: as JSON and in words.

One component: the indicator that tells its wear, its life, and the work ahead of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.config.prognosis import IndicatorSpec
from evertwin.fold import plain
from evertwin.prognosis.formula import Formula
from evertwin.prognosis.histories.health import unless_overdue
from evertwin.prognosis.histories.observed_series import component_of
from evertwin.prognosis.laws import Fleet, Indicator, Life, NotEnough, Workload, predict_life
from evertwin.prognosis.laws.plans.alarms import Alarm
from evertwin.prognosis.laws.predict import LASTING, held_back
from evertwin.prognosis.laws.series.calendar import UNITS, Calendar
from evertwin.prognosis.laws.wear.hypotheses import LAWS
from evertwin.prognosis.likes.another_type import of_its_type
from evertwin.prognosis.outlook.course import Course, course, courses_by_law
from evertwin.types import Json

OTHER = 1.3
"""Pace from which a machine is said to differ from its fleet."""
DOUBTED = 0.25
"""Chance of another form from which it is said."""


@dataclass(frozen=True)
class ComponentLife:
    """One component: its indicator and its life.

    >>> ComponentLife.__name__
    'ComponentLife'
    """

    component: str
    rule: IndicatorSpec
    indicator: Indicator
    life: Life | NotEnough
    """Under the work ahead."""
    before: Life | NotEnough
    """If work went on as before."""
    wears: Formula
    """Wear per second of a simulated cycle."""
    work: Workload | None = None
    """Wear ahead, in that of the past; None: as before."""
    course: Course | None = None
    by_law: Mapping[str, Course] = field(default_factory=dict)
    """What the laws of some weight say alone; for pictures."""
    fleet: Fleet | None = None
    """What like machines told."""

    @property
    def age(self) -> float:
        """Time in use since it was new or replaced, on the clock."""
        now = self.indicator.since_replaced()
        start = now.origin if now.origin is not None else (now.at[0] if len(now.at) else 0.0)
        return float(now.at[-1] - start) if len(now.at) else 0.0

    @property
    def rate(self) -> float:
        """Wear under the work ahead over that of the past, on the mean until the median life."""
        if self.work is None or not isinstance(self.life, Life):
            return 1.0
        return self.work.mean_rate(self.life.median)

    @property
    def phases(self) -> list[dict[str, float | None]]:
        """The work ahead: begin and end of each phase, and its wear over that of the past."""
        if self.work is None:
            return []
        begins: list[float] = self.work.time[:-1].tolist()
        ends = [*begins[1:], None]
        rows = zip(begins, ends, self.work.rates.tolist(), strict=True)
        return [{"begin": a, "until": b, "rate": rate} for a, b, rate in rows]

    @property
    def ahead(self) -> str:
        """The work ahead in words; empty where it is as before."""
        if self.work is None or not np.any(self.work.rates != 1.0):
            return ""
        said = []
        for phase in self.phases:
            rate, until = phase["rate"], phase["until"]
            how = "rest" if rate == 0.0 else "as before" if rate == 1.0 else (
                f"{rate:.3g} times as fast"
            )  # fmt: skip
            end = "on" if until is None else f"to {until:g}"
            alone = len(self.work.rates) == 1
            said.append(how if alone else f"from {phase['begin']:g} {end}: {how}")
        return f"wears under the work ahead, by {self.wears.text}: " + "; ".join(said)

    @property
    def pace(self) -> str:
        """That its like machines wear at another pace; empty where they do not."""
        pace = self.life.pace if isinstance(self.life, Life) else None
        if pace is None or 1.0 / OTHER < pace < OTHER:
            return ""
        return (
            f"{self.component} takes {pace:.2g} times as long as its like machines did for the "
            "same wear: their times are scaled to that, and the interval is wider"
        )

    @property
    def doubted(self) -> str:
        """That its course may be of another shape than theirs; empty where it is not."""
        chance = self.life.other if isinstance(self.life, Life) else 0.0
        if chance < DOUBTED:
            return ""
        return (
            f"{self.component} wears by a course of another shape than its like machines, with "
            f"probability {chance:.2g}: by so much its life is told alone"
        )

    @property
    def by_itself(self) -> str:
        """What a life told from one series alone is worth; empty where it is not."""
        told = self.life if isinstance(self.life, Life) else None
        if self.fleet is not None or told is None or told.passed is not None:
            return ""
        return (
            "told without like machines (--fleet): of all drawn kinds of wear together four ends "
            "in five lie inside 80 %, and nothing foretells one that comes at once"
        )

    @property
    def held_back(self) -> str:
        """That newest values beyond the limit do not end its life yet; empty where none are."""
        few = held_back(self.indicator)
        if not few or (isinstance(self.life, Life) and self.life.passed is not None):
            return ""
        values = "value lies" if few == 1 else f"{few} values lie"
        return (
            f"its newest {values} beyond the limit: {LASTING - few} more in a row would end its "
            "life, one on this side shows a wrong reading"
        )

    @property
    def urgency(self) -> float:
        """Median life; infinite where it is not known."""
        return self.life.median if isinstance(self.life, Life) else float("inf")

    @property
    def sentence(self) -> str:
        """What is known, in one sentence."""
        return said(self.life)


def told_of(
    rule: IndicatorSpec, own: Indicator, likes: Fleet | None, *, drawn: bool
) -> ComponentLife:
    """The life of a component under work as before.

    Args:
        rule: what tells its wear.
        own: its indicator, seen from now.
        likes: like machines, which are left out where they are of another type.
        drawn: with its course, for pictures.
    """
    fleet, unlike = of_its_type(own, likes)
    own = own.with_(notes=(*own.notes, *unlike))
    laws = rule.laws or LAWS
    life = unless_overdue(own, predict_life(own, laws, fleet))
    way, by_law = None, dict[str, Course]()
    if drawn and isinstance(life, Life):
        way, by_law = course(own, life, laws, fleet), courses_by_law(own, life)
    whose = component_of(rule)
    return ComponentLife(
        whose, rule, own, life, life, Formula.parse("1"), course=way, by_law=by_law, fleet=fleet
    )


def said(life: Life | NotEnough) -> str:
    """A life in words.

    >>> said(NotEnough("six values", "there are two"))
    'not enough data: needs six values; there are two'
    """
    if isinstance(life, NotEnough):
        return "; ".join(
            part for part in (f"not enough data: needs {life.needs}", life.reason) if part
        )
    told = life.calendar
    if life.passed is not None:
        when = f"{life.passed:.4g} {life.unit}" if told is None else told.said(life.passed)
        return f"life is over: {'it failed' if life.failed else 'the limit was passed'} at {when}"
    low, high = life.interval80
    ends = f"{high:.4g}" if high < float("inf") else "without end"
    law = f", law {life.law}" if life.law else ", by like machines" if life.pace else ""
    if told is not None:
        first, half, last, surely = (
            told.said(life.now + x, zone=x == life.median)
            for x in (low, life.median, high, life.not_before)
        )
        gone = life.gone
        parts = "" if "interval80" in gone else ", or some of them,"
        past = f"; these dates{parts} lie in the past: counted from the newest row"
        return (
            f"ends on {half} (80 %: {first} … {last}), not before {surely} (95 %){law}; in "
            f"{life.median:.4g} {life.unit}{past if gone else ''}"
        )
    return (
        f"{life.median:.4g} {life.unit} (80 %: {low:.4g} … {ends}), not before "
        f"{life.not_before:.4g} (95 %){law}"
    )


SCHEMA = "evertwin.life/1"


@dataclass(frozen=True)
class Lives:
    """The outcome of `Twin.life`.

    >>> Lives("arm", "run", {}, None).to_dict()["schema"]
    'evertwin.life/1'
    """

    name: str
    clock: str
    components: Mapping[str, ComponentLife]
    machine: Life | NotEnough | None
    """First of its critical components; None: there is none."""
    alarms: tuple[Alarm, ...] = ()
    """What is due; those raised are in the store's log."""
    held: tuple[Alarm, ...] = ()
    """Alarms over the day's budget."""
    alarms_today: int = 0
    dates: tuple[float, ...] = ()
    """Times from now at which probabilities of failure are given."""
    indicators: tuple[ComponentLife, ...] = field(default=())
    """Every indicator, also those that do not stand for their component."""
    now: float = 0.0
    """The moment that lives are counted from, on the clock."""
    left_out: tuple[str, ...] = ()
    """Labels of the store that do not count, and why."""

    @property
    def calendar(self) -> Calendar | None:
        """Where the clock counts from 1970."""
        return next((c for one in self.indicators if (c := one.indicator.calendar)), None)

    @property
    def since(self) -> str:
        """How long ago, by this computer, the moment was that dated lives are counted from."""
        told = self.calendar
        if told is None or not self.now:
            return ""
        ago = (told.today() - self.now) * UNITS[self.clock] / UNITS["d"]
        how = f", {abs(ago):.3g} days {'ago' if ago > 0.0 else 'ahead of today'}"
        return f"lives are counted from {told.said(self.now)}{how if abs(ago) > 0.1 else ''}"

    @property
    def notes(self) -> tuple[str, ...]:
        """What may surprise in how the history was read."""
        told = (note for one in self.indicators for note in one.indicator.notes)
        likes = (note for one in self.indicators if one.fleet for note in one.fleet.told)
        differs = (note for one in self.indicators for note in (one.pace, one.doubted) if note)
        return tuple(dict.fromkeys((*told, *likes, *differs, *self.left_out)))

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.life/1"``."""
        parts = {}
        for name, one in self.components.items():
            entry = entry_of(one.indicator, one.life, self.dates)
            parts[name] = entry | {
                "rate": one.rate, "age": one.age, "wear": one.wears.text, "phases": one.phases,
                "sentence": one.sentence, "held_back": one.held_back,
                "by_itself": one.by_itself,
                "fleet": [x._asdict() for x in one.fleet.members] if one.fleet else [],
            }  # fmt: skip
        content: dict[str, Any] = {
            "schema": SCHEMA, "components": parts,
            "name": self.name, "clock": self.clock, "now": self.now,
            "now_date": None if self.calendar is None else self.calendar.iso(self.now),
            "machine": None if self.machine is None else self.machine.document(),
            "alarms": self.alarms, "alarms_held_back": self.held,
            "alarms_today": self.alarms_today, "notes": self.notes,
        }  # fmt: skip
        return plain(content)  # type: ignore[return-value]

    def __str__(self) -> str:
        """One line per component, then the machine and the alarms."""
        lines = []
        for name, one in self.components.items():
            known = one.indicator.value
            known = known[np.isfinite(known)]
            value = one.indicator.shown(known[-1]) if len(known) else "no value"
            limit = one.indicator.limit
            held = f"; {one.held_back}" if one.held_back else ""
            lines.append(
                f"{name}: {one.indicator.name} {value}, limit "
                f"{one.indicator.shown(limit.value)} ({limit.source}){held}\n  {one.sentence}"
            )
            lines += [f"  {one.ahead}"] if one.ahead else []
        if self.machine is not None:
            lines.append(f"machine: {said(self.machine)}")
        lines += [f"! {alarm.reason}\n  {alarm.action}" for alarm in self.alarms]
        if self.held:
            lines.append(f"held back, over the budget of the day: {len(self.held)}")
        lines += [f"  {a.component}: {a.kind.replace('_', ' ')}: {a.reason}" for a in self.held]
        alone = next(filter(None, (one.by_itself for one in self.indicators)), "")
        lines += [self.since, f"note: {alone}" if alone else ""]
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(filter(None, lines)) or "no [[indicator]] in the twin file"


def entry_of(
    indicator: Indicator, life: Life | NotEnough, dates: Sequence[float] = ()
) -> dict[str, object]:
    """An indicator and its life in the document; ``dates``: times from now, in the life's unit."""
    known = indicator.value[np.isfinite(indicator.value)]
    weights = {name: round(float(w), 4) for name, w in life.laws.items()}
    before: dict[str, float] | None = None
    if isinstance(life, Life):
        before = {f"{date:.12g}": life.probability_before(date) for date in dates}
    return {
        "indicator": indicator.name,
        "unit": indicator.unit,
        "value": float(known[-1]) if len(known) else None,
        "limit": indicator.limit.value,
        "direction": indicator.limit.direction,
        "limit_source": indicator.limit.source,
        "law": max(weights, key=lambda name: weights[name]) if weights else None,
        "laws": weights,
        "life": life.document(),
        "probability_before": before,
    }
