"""Indicators from what is known: the parameter history, a file, the residual, a quality figure.

Every ``[[indicator]]`` of the twin file becomes an `Indicator`: its series on the clock of the
prognosis, its limit with where that comes from, its covariates and the maintenance done.

Lives from one moment: an indicator that has not been seen for a while is looked at from now.

A quality figure may end eight runs before the newest run, and a parameter may not have been told
apart lately. Life is counted from now all the same: the laws are followed up to it, on condition
that the component still works.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from evertwin.config.prognosis import IndicatorSpec
from evertwin.errors import ConfigError, DataError, UsageError, nearest
from evertwin.models import Model, Parameters
from evertwin.prognosis.formula import Formula
from evertwin.prognosis.histories.believed import DROPPED
from evertwin.prognosis.histories.history_file import of_table
from evertwin.prognosis.histories.observed_series import (
    Observed,
    component_of,
    in_unit,
    marks_of,
    warm_of,
)
from evertwin.prognosis.histories.parameter_history import History
from evertwin.prognosis.laws import Indicator, Life, Limit, NotEnough
from evertwin.prognosis.laws.series.indicator import divided
from evertwin.signals.units import compatible, from_si
from evertwin.sources.texts.small_table import Table, read_table
from evertwin.types import Vector

SEVERAL = 3
"""Adjustments from which more are likely."""


def check_names(rule: IndicatorSpec, model: Model, found: History) -> None:
    """Refuses what neither the model nor the history knows: it would never have a value.

    Raises:
        ConfigError: with the nearest name.
    """
    tuned = dict.fromkeys((*model.parameters.names, *found.names))
    adjusted = (*rule.covariates, *rule.factors, *(() if rule.warm_up is None else ("warm_up",)))
    told: list[tuple[str, Sequence[str], Sequence[str]]] = [
        ("reference", tuple(rule.reference), adjusted),
        ("output", [] if rule.output is None else [rule.output], model.outputs.names),
    ]
    if rule.parameter is not None:
        told.append(("parameter", [rule.parameter], tuple(tuned)))
    if rule.formula is not None:
        told.append(("formula", Formula.parse(rule.formula).names, tuple(tuned)))
    for key, names, known in told:
        for name in names:
            if name not in known:
                hint = nearest(name, known) if known else "there is no covariate and no factor"
                raise ConfigError(f"indicator {rule.name}: {key}: no {name!r}, {hint}")


def names_of(rule: IndicatorSpec) -> tuple[str, ...]:
    """The tuned parameters that an indicator tells of."""
    if rule.file is not None or rule.output is not None:
        return ()
    if rule.formula is not None:
        return Formula.parse(rule.formula).names
    return () if rule.parameter is None else (rule.parameter,)


def uncounted(rule: IndicatorSpec, found: History, parameters: Parameters) -> tuple[str, ...]:
    """Notes on what a fit said of an indicator last that does not count, and on what would look the
    same as what does."""
    names, told = names_of(rule), []
    alike, (counts, left) = found.in_doubt(names), found.newest(names)
    # of a moment that tells already, what was dropped behind it says nothing new
    known_then = left is not None and counts is not None and counts.at >= left.at
    if left is not None and left.why and not (known_then and left.why == DROPPED):
        known = [item for item in parameters if item.name in names and item.name in left.left]
        value = ", ".join(
            f"{one.name} {float(from_si(left.left[one.name][0], one.unit)):.4g} {one.unit}"
            for one in known
        )
        at = (
            f"{left.at:.6g} {found.clock}"
            if found.calendar is None
            else found.calendar.said(left.at)
        )
        told.append(f"{rule.name}: {value}, told at {at}, does not count: {left.why}")
    if alike:
        told.append(
            f"{rule.name}: {'; '.join(alike)}; no alarm is raised before the limit is passed until "
            "somebody says which it is: evertwin label … true (the machine), cause or faulty"
        )
    return tuple(told)


def series_of(
    rule: IndicatorSpec, found: History, table: Table | None, folder: Path,
    components: Sequence[str] = (),
) -> Observed:  # fmt: skip
    """The series of an indicator.

    Args:
        rule: which.
        found: the store's parameter history.
        table: a history file in its place.
        folder: where file names of the twin file start from.
        components: all that the twin tells of.

    Raises:
        DataError: a column is missing.
        ConfigError: nothing says where its values come from.
    """
    if rule.file is not None:
        table = read_table(folder / rule.file)
    if table is not None:
        return of_table(rule, table, found.clock, found.events, components)
    if rule.usage:
        raise ConfigError(f"indicator {rule.name}: usage is a column of a history file: give one")
    marks = marks_of(component_of(rule), found.events, found.clock)
    if rule.output is not None:
        pairs = [(m.at, m.deviation[rule.output]) for m in found.moments
                 if rule.output in m.deviation]  # fmt: skip
        at, value = (np.array([p[k] for p in pairs], dtype=np.float64) for k in (0, 1))
        sigma = np.full(len(at), np.nan)
    elif rule.formula is not None:
        formula = Formula.parse(rule.formula)
        at, values, sigmas = found.series(formula.names)
        value, sigma = _through(formula, values, sigmas, len(at))
    elif rule.parameter is not None:
        at, values, sigmas = found.series((rule.parameter,))
        value, sigma = values[rule.parameter], sigmas[rule.parameter]
    else:
        raise ConfigError(
            f"indicator {rule.name}: expected a parameter, a formula, an output or a file"
        )
    adds = {name: found.beside(name, at) for name in rule.covariates}
    multiplies = {name: found.beside(name, at) for name in rule.factors}
    multiplies |= warm_of(rule, found.since_start(at))
    told = Observed(at, value, sigma, adds, multiplies, None, marks, calendar=found.calendar)
    return in_unit(rule, told)


def _through(
    formula: Formula, values: Mapping[str, Vector], sigmas: Mapping[str, Vector], n: int
) -> tuple[Vector, Vector]:
    """The formula's value and standard deviation, row by row."""
    value = np.full(n, formula(values))
    square = np.zeros(n)
    for name in formula.names:
        step = 1e-6 * np.maximum(np.abs(values[name]), 1e-9)
        slope = (formula({**values, name: values[name] + step}) - value) / step
        square += (slope * sigmas[name]) ** 2
    return value, np.sqrt(square)


def indicator_of(
    rule: IndicatorSpec, known: Observed, limit: Limit, clock: str, parameters: Parameters | None
) -> Indicator:
    """The indicator: a series with its limit.

    Raises:
        DataError: the values are in a unit of another kind.
    """
    unit = rule.unit
    if not unit and parameters is not None and rule.parameter in parameters.names:
        unit = parameters[str(rule.parameter)].unit
    if unit and known.unit and not compatible(unit, known.unit):
        raise DataError(
            f"indicator {rule.name}: expected values in a unit like {unit}, got a column in one "
            f"like {known.unit}: correct its heading, or unit in the twin file"
        )
    unit = unit or known.unit or "1"
    found = Indicator.of(rule.name, unit, limit, known.at, known.value).with_(
        sigma=known.sigma, clock=clock, covariates=dict(known.covariates), usage=known.usage,
        maintenance=known.maintenance, reference=dict(rule.reference), notes=known.notes,
        calendar=known.calendar,
    )  # fmt: skip
    found = found.with_(notes=(*found.notes, *_adjusted(found)))
    warm = {"warm_up": 0.0} if "warm_up" in known.factors else {}
    return divided(found, known.factors, warm | dict(rule.reference))


def _adjusted(indicator: Indicator) -> tuple[str, ...]:
    """Says that a life holds without another adjustment, where there were several."""
    life = indicator.since_replaced()
    marks = [m.at for m in life.maintenance if m.kind == "adjusted"]
    if len(marks) < SEVERAL:
        return ()
    every = float(np.median(np.diff(sorted(marks))))
    return (
        f"{indicator.name}: it was adjusted {len(marks)} times, about every {every:.4g} "
        f"{indicator.clock}; its life is told as if it were not adjusted again",
    )


def seen(indicator: Indicator, now: float) -> Indicator:
    """The indicator as it is looked at from ``now``, with a note where its newest value is older.

    >>> from evertwin.prognosis.laws import Limit
    >>> weld = Indicator.of("weld", "mm", Limit(3.0), [0, 8], [1.0, 1.1])
    >>> seen(weld, 14.0).notes
    ('weld: its newest value is 6 run old',)
    """
    last = newest(indicator)
    if last is None or now <= last:
        return indicator
    old = f"{indicator.name}: its newest value is {now - last:.4g} {indicator.clock} old"
    return indicator.seen_at(now).with_(notes=(*indicator.notes, old))


def today_of(found: Sequence[Indicator]) -> float:
    """Today on the clock of dated series.

    Raises:
        UsageError: none of them has dates.
    """
    calendar = next((one.calendar for one in found if one.calendar is not None), None)
    if calendar is None:
        raise UsageError("--today: expected rows with dates, got a clock without: leave it out")
    return calendar.today()


def unless_overdue(indicator: Indicator, life: Life | NotEnough) -> Life | NotEnough:
    """The life; a newer value is needed where only the laws say that the limit was passed since."""
    last = newest(indicator)
    if isinstance(life, NotEnough) or life.passed is None or last is None or life.passed <= last:
        return life
    needs = f"a newer value than that of {indicator.moment(last)}"
    return NotEnough(needs, "by its laws the limit has been passed since", laws=life.laws)


def newest(indicator: Indicator) -> float | None:
    """When the newest value was taken; None without any."""
    known = np.flatnonzero(np.isfinite(indicator.value))
    return float(indicator.at[known[-1]]) if len(known) else None
