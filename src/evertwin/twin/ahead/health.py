"""Indicators from what is known: the parameter history, a file, the residual, a quality figure.

Every ``[[indicator]]`` of the twin file becomes an `Indicator`: its series on the clock of the
prognosis, its limit with where that comes from, its covariates and the maintenance done.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin.config.prognosis import IndicatorSpec
from evertwin.errors import ConfigError, DataError
from evertwin.fold import Event
from evertwin.models import Parameters
from evertwin.prognosis import Indicator, Limit, Maintenance
from evertwin.prognosis.factors import divided
from evertwin.twin.ahead.formula import Formula
from evertwin.twin.ahead.history import UNITS, History
from evertwin.twin.ahead.table import Table, read_table
from evertwin.types import Vector

__all__ = ["Known", "component_of", "indicator_of", "of_table", "series_of"]

CLOCKS = ("run", "cycle", "t", "time", "date", "datetime", "timestamp")
"""Columns that a history may be counted by, in order."""


class Known(NamedTuple):
    """A series before its limit is known.

    >>> Known._fields[:3]
    ('at', 'value', 'sigma')
    """

    at: Vector
    value: Vector
    sigma: Vector
    covariates: Mapping[str, Vector]
    factors: Mapping[str, Vector]
    usage: Vector | None
    maintenance: tuple[Maintenance, ...]


def component_of(rule: IndicatorSpec) -> str:
    """The component whose life an indicator tells."""
    return rule.component or rule.name


def series_of(rule: IndicatorSpec, found: History, table: Table | None, folder: Path) -> Known:
    """The series of an indicator.

    Args:
        rule: which.
        found: the store's parameter history.
        table: a history file in its place.
        folder: where file names of the twin file start from.

    Raises:
        DataError: a column is missing.
        ConfigError: nothing says where its values come from.
    """
    if rule.file is not None:
        return of_table(rule, read_table(folder / rule.file), found.clock, found.events)
    if table is not None:
        return of_table(rule, table, found.clock, found.events)
    if rule.usage:
        raise ConfigError(f"indicator {rule.name}: usage is a column of a history file: give one")
    marks = _marks(component_of(rule), found.events, found.clock)
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
    multiplies |= _warm(rule, found.since_start(at))
    return Known(at, value, sigma, adds, multiplies, None, marks)


def _warm(rule: IndicatorSpec, since_start: Vector) -> dict[str, Vector]:
    """The influence of warm-up, by the time since start [s]."""
    return {} if rule.warm_up is None else {"warm_up": np.exp(-since_start / rule.warm_up)}


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


def of_table(rule: IndicatorSpec, table: Table, clock: str, events: Sequence[Event] = ()) -> Known:
    """The series in a history file.

    Raises:
        DataError: the value, a covariate or the clock is missing.
    """
    wanted = [n for n in (rule.column, rule.name, rule.parameter) if n]
    given = [n for n in wanted if n in table.names]
    if not given:  # says which cell is no number, or which columns there are
        table.column(next((n for n in wanted if n in table.text), rule.column or rule.name))
    name = str(given[0])
    at = _at(table, clock)
    if not np.isfinite(at).all():
        line = table.lines[int(np.argmin(np.isfinite(at)))] if table.lines else 0
        raise DataError(f"{table.name}:{line}: expected when the value was known, got no {clock}")
    order = np.argsort(at, kind="stable")
    warm = {} if rule.warm_up is None else _warm(rule, table.column("since_start")[order])
    sigma = np.full(table.rows, np.nan)
    for column in (f"{name}.sigma", "sigma"):
        if column in table.names:
            sigma = table.column(column)
            break
    marks = _written(table, component_of(rule), at) + _marks(component_of(rule), events, clock)
    return Known(
        at[order], table.column(name)[order], sigma[order],
        {c: table.column(c)[order] for c in rule.covariates},
        {c: table.column(c)[order] for c in rule.factors} | warm,
        None if rule.usage is None else table.column(rule.usage)[order],
        tuple(sorted(marks, key=lambda m: m.at)),
    )  # fmt: skip


def _at(table: Table, clock: str) -> Vector:
    """The clock's column; time in its unit."""
    if clock not in UNITS:
        for name in (clock, "run", "cycle"):
            if name in table.names:
                return table.column(name)
        return np.arange(1.0, table.rows + 1.0)
    if clock in table.names:
        return table.column(clock)
    for name in CLOCKS[2:]:
        if name in table.names:
            return table.column(name) / UNITS[clock]
    raise DataError(
        f"{table.name}: expected a column {clock!r}, or one of {', '.join(CLOCKS[2:])}, to count "
        "life by; got " + ", ".join(table.names)
    )


def _written(table: Table, component: str, at: Vector) -> tuple[Maintenance, ...]:
    """Marks in a column ``maintenance``: ``gearbox1: replaced``, or plain text for all."""
    marks = []
    for moment, text in zip(at.tolist(), table.text.get("maintenance", ()), strict=False):
        whom, _, said = text.rpartition(":")
        if text and (not whom or whom.strip() == component):
            kind: Any = "adjusted" if "adjusted" in said else "replaced"
            marks.append(Maintenance(moment, kind, said.strip()))
    return tuple(marks)


def _marks(component: str, events: Sequence[Event], clock: str) -> tuple[Maintenance, ...]:
    """Maintenance that the store has kept for a component, on this clock."""
    marks = []
    for event in events:
        evidence: Any = event.evidence
        if event.kind == "maintained" and event.signal == component and evidence["clock"] == clock:
            marks.append(Maintenance(float(evidence["at"]), evidence["kind"], event.reason))
    return tuple(marks)


def indicator_of(
    rule: IndicatorSpec, known: Known, limit: Limit, clock: str, parameters: Parameters
) -> Indicator:
    """The indicator: a series with its limit.

    Raises:
        DataError: the series has no value at all that is a number.
    """
    unit = rule.unit
    if not unit and rule.parameter is not None and rule.parameter in parameters.names:
        unit = parameters[rule.parameter].unit
    found = Indicator.of(rule.name, unit or "1", limit, known.at, known.value).with_(
        sigma=known.sigma, clock=clock, covariates=dict(known.covariates), usage=known.usage,
        maintenance=known.maintenance, reference=dict(rule.reference),
    )  # fmt: skip
    warm = {"warm_up": 0.0} if "warm_up" in known.factors else {}
    return divided(found, known.factors, warm | dict(rule.reference))
