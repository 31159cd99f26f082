"""The lives of a machine's components, from the parameter history to dates and alarms.

Each ``[[indicator]]`` gets its series, its limit and its life. Where several tell of one component
the most urgent stands for it. The machine lasts as long as the first of its critical components.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from evertwin.ahead.basis import Basis
from evertwin.ahead.whatif import Today, today
from evertwin.config.prognosis import IndicatorSpec, PrognosisSpec
from evertwin.errors import ConfigError
from evertwin.prognosis.histories.contradictions import check_end, check_limit
from evertwin.prognosis.histories.health import (
    check_names,
    indicator_of,
    names_of,
    seen,
    series_of,
    today_of,
    uncounted,
)
from evertwin.prognosis.histories.observed_series import Observed, component_of
from evertwin.prognosis.histories.parameter_history import History, history
from evertwin.prognosis.histories.steps import check_steps
from evertwin.prognosis.laws import (
    Fleet,
    Indicator,
    Life,
    Limit,
    NotEnough,
    first_of,
)
from evertwin.prognosis.laws.plans.alarms import alarm_of
from evertwin.prognosis.laws.series.calendar import Calendar
from evertwin.prognosis.likes.like_machines import Likes, files_of, fleet_of, past_of
from evertwin.prognosis.outlook.alarm_log import called_false, time_ahead
from evertwin.prognosis.outlook.limits import accuracy_limit, breakdown_limits, limit_of
from evertwin.prognosis.outlook.lives import ComponentLife, Lives, said, told_of
from evertwin.prognosis.outlook.workplan import Plan, past_cycles, plan_of, wears, workload
from evertwin.rows.feed import Data
from evertwin.signals.units import from_si, to_si
from evertwin.sources.texts.small_table import Table

UNKEPT = (
    "the twin file names no store, so that no run is remembered: set [store] path, run the twin, "
    "and ask again; or give --history"
)


@dataclass(frozen=True)
class Prospect:
    """Everything that lives are told from.

    >>> Prospect.__name__
    'Prospect'
    """

    basis: Basis
    data: Data = None
    """Recordings, for what needs the newest task."""
    table: Table | None = None
    """A history file in place of the store's."""
    from_today: bool = False
    """Lives are counted from today, on condition that all still works; else from the newest row."""

    @property
    def rule(self) -> PrognosisSpec:
        """The section ``[prognosis]``."""
        return self.basis.setup.spec.prognosis

    @property
    def folder(self) -> Path:
        """Where file names start from."""
        return Path(self.basis.setup.spec.folder)

    @cached_property
    def history(self) -> History:
        """The store's."""
        return history(self.basis.store, self.rule.clock, self.basis.model.parameters)

    @property
    def parts(self) -> tuple[str, ...]:
        """Every component that an indicator tells of."""
        return tuple(component_of(rule) for rule in self.basis.setup.spec.indicator)

    @cached_property
    def today(self) -> Today:
        """The newest recorded task."""
        return today(self.basis, self.data)

    @cached_property
    def planned(self) -> Plan:
        """The work ahead, ready to be simulated."""
        return plan_of(self.basis, self.today, self.basis.setup.spec.work)

    @cached_property
    def broken_down(self) -> dict[str, Limit]:
        """Limits of the breakdown file."""
        name = self.rule.breakdown
        return {} if name is None else breakdown_limits(self.folder / name)

    def observed(self, rule: IndicatorSpec) -> Observed:
        """The series of an indicator, before its limit is known.

        Raises:
            DataError: its history cannot be read.
        """
        return series_of(rule, self.history, self.table, self.folder, self.parts)

    def indicator(self, rule: IndicatorSpec) -> Indicator:
        """An indicator with its limit.

        Raises:
            ConfigError: nothing says where its life ends, or it names what is not known.
            DataError: its history cannot be read.
        """
        if self.table is None:
            check_names(rule, self.basis.model, self.history)
        known = self.observed(rule)
        limit = limit_of(rule, self.broken_down, self._felt(rule, known))
        parameters = self.basis.model.parameters
        found = indicator_of(rule, known, limit, self.rule.clock, parameters)
        if self.table is not None or rule.file:
            file = self.table.name if self.table else str(rule.file)
            check_limit(found, file, alone=False)
            check_end(found, file, self.table)
            check_steps(found, file, known.lines)
        else:
            more = uncounted(rule, self.history, parameters)
            value, false = found.value, called_false(self.basis.store, component_of(rule))
            value = np.where(np.isin(value, false), np.nan, value)
            found = found.with_(value=value, notes=(*found.notes, *more))
        kept = self.table is not None or rule.file or self.history.moments
        if kept or self.basis.setup.spec.store.path is not None:
            return found
        return found.with_(notes=(*found.notes, UNKEPT))

    @property
    def now(self) -> float:
        """The moment that all lives are counted from."""
        return max((float(one.at[-1]) for one in self.series if len(one.at)), default=0.0)

    def _felt(self, rule: IndicatorSpec, known: Observed) -> float | None:
        if rule.accuracy is None or rule.limit is not None or rule.parameter is None:
            return None
        first = [to_si(x, rule.unit) if rule.unit else x for x in known.value[:1].tolist()]
        item = self.basis.setup.model.parameters[rule.parameter]
        new = from_si(first[0], item.unit) if first else item.value
        case = self.today.case
        felt = accuracy_limit(case.model, case.p, case.future, rule, new)
        return None if felt is None else float(to_si(felt, item.unit))

    def fleet(self, rule: IndicatorSpec, indicator: Indicator) -> Fleet | None:
        """What like machines and earlier lives tell of an indicator; None without any."""
        own = self.basis.setup.spec.store.place(self.folder)
        mine = (own,) if isinstance(own, Path) else ()
        files, failed = (
            files_of(names, self.folder, mine) for names in (self.rule.fleet, self.rule.failed)
        )
        return fleet_of(Likes(
            rule, indicator.limit, self.rule.clock, files, failed, self.parts,
            self.basis.model.parameters, past=past_of(indicator),
        ))  # fmt: skip

    @cached_property
    def series(self) -> tuple[Indicator, ...]:
        """Every indicator, each seen from the same moment: the newest that any of them knows."""
        found = [self.indicator(rule) for rule in self.basis.setup.spec.indicator]
        newest = [float(one.at[-1]) for one in found if len(one.at)]
        now = max([*newest, 0.0 if self.table is not None else self.history.now])
        if self.from_today:
            now = max(now, today_of(found))
        return tuple(seen(one, now) for one in found)

    @property
    def calendar(self) -> Calendar | None:
        """Where the clock counts from 1970."""
        known = (self.observed(rule).calendar for rule in self.basis.setup.spec.indicator)
        return next((one for one in known if one is not None), None)

    def life(self, rule: IndicatorSpec, *, drawn: bool = False) -> ComponentLife:
        """The life that one indicator tells; ``drawn``: with its course."""
        indicator = self.series[self.basis.setup.spec.indicator.index(rule)]
        one = told_of(rule, indicator, self.fleet(rule, indicator), drawn=drawn)
        one = replace(one, wears=wears(rule, self.basis.model))
        if not self.basis.setup.spec.work or not isinstance(one.life, Life):
            return one
        work = workload(one.wears, self.planned, past_cycles(self.rule, indicator))
        return replace(
            one, life=one.life.through(work, one.life.unit), work=work,
            course=None if one.course is None else one.course.through(work),
            by_law={law: way.through(work) for law, way in one.by_law.items()},
        )  # fmt: skip

    def lives(self, *, drawn: bool = False) -> Lives:
        """All components.

        Raises:
            ConfigError: the twin file names no indicator.
        """
        spec = self.basis.setup.spec
        if not spec.indicator:
            raise ConfigError(
                f"{spec.name}: expected an [[indicator]] in the twin file: it says what tells wear "
                "and where life ends"
            )
        every = tuple(self.life(rule, drawn=drawn) for rule in spec.indicator)
        components: dict[str, ComponentLife] = {}
        for one in every:
            old = components.get(one.component)
            if old is None or one.urgency < old.urgency:
                components[one.component] = one
        due = (
            alarm_of(
                name, one.indicator, one.life, time_ahead(self.rule, one), self.rule.risk,
                self._in_doubt(one.rule),
            )
            for name, one in components.items()
        )  # fmt: skip
        return Lives(
            spec.name, self.rule.clock, components, self._machine(components),
            tuple(alarm for alarm in due if alarm is not None), dates=self.dates,
            indicators=every, left_out=self.history.notes, now=self.now,
        )  # fmt: skip

    def _in_doubt(self, rule: IndicatorSpec) -> tuple[str, ...]:
        """What would look as the wear does."""
        return () if self.table is not None else self.history.in_doubt(names_of(rule))

    @property
    def dates(self) -> tuple[float, ...]:
        """Times from now at which probabilities are told: windows, else the time ahead."""
        rule = self.rule
        if rule.windows is None:
            return () if rule.lead is None or rule.lead.share else (rule.lead.size,)
        dates = (rule.window + k * rule.windows for k in range(5))
        return tuple(date for date in dates if date > 0.0)[:4]

    def _machine(self, components: Mapping[str, ComponentLife]) -> Life | NotEnough | None:
        costs = self.rule.components
        unknown = set(costs) - {component_of(rule) for rule in self.basis.setup.spec.indicator}
        if unknown:
            raise ConfigError(
                f"[prognosis.components]: no [[indicator]] tells of {', '.join(sorted(unknown))}"
            )
        critical = {
            name: one.life
            for name, one in components.items()
            if name not in costs or costs[name].critical
        }
        known = [life for life in critical.values() if isinstance(life, Life)]
        unknown_lives = [name for name, life in critical.items() if isinstance(life, NotEnough)]
        if not unknown_lives:
            return first_of(known) if known else None
        bound = f"the others last {said(first_of(known))}" if known else ""
        return NotEnough(f"the life of {', '.join(unknown_lives)}", bound)
