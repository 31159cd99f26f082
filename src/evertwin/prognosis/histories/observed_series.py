"""A series before its limit is known, from the store or from a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from evertwin.config.prognosis import IndicatorSpec
from evertwin.fold import Event
from evertwin.prognosis.laws import Maintenance
from evertwin.prognosis.laws.series.calendar import Calendar
from evertwin.signals.units import conversion, from_si
from evertwin.types import Vector


class Observed(NamedTuple):
    """A series before its limit is known.

    >>> Observed._fields[:3]
    ('at', 'value', 'sigma')
    """

    at: Vector
    value: Vector
    sigma: Vector
    covariates: Mapping[str, Vector]
    factors: Mapping[str, Vector]
    usage: Vector | None
    maintenance: tuple[Maintenance, ...]
    notes: tuple[str, ...] = ()
    """What may surprise in how it was read."""
    unit: str = ""
    """Of the values, as far as their file says it."""
    calendar: Calendar | None = None
    """Where times are counted from 1970."""
    lines: tuple[int, ...] = ()
    """Of each row in its file; of the store's history there are none."""
    by: str = ""
    """The column that life is counted by; empty: rows are, or the store's moments."""


def component_of(rule: IndicatorSpec) -> str:
    """The component whose life an indicator tells."""
    return rule.component or rule.name


def in_unit(rule: IndicatorSpec, known: Observed) -> Observed:
    """A series of SI values in the unit that the indicator is told in."""
    if not rule.unit:
        return known
    value = np.asarray(from_si(known.value, rule.unit), dtype=np.float64)
    return known._replace(value=value, sigma=known.sigma / conversion(rule.unit)[0])


def warm_of(rule: IndicatorSpec, since_start: Vector) -> dict[str, Vector]:
    """The influence of warm-up, by the time since start [s]."""
    return {} if rule.warm_up is None else {"warm_up": np.exp(-since_start / rule.warm_up)}


def marks_of(component: str, events: Sequence[Event], clock: str) -> tuple[Maintenance, ...]:
    """Maintenance that the store has kept for a component, on this clock."""
    marks = []
    for event in events:
        evidence: Any = event.evidence
        if event.kind == "maintained" and event.signal == component and evidence["clock"] == clock:
            marks.append(Maintenance(float(evidence["at"]), evidence["kind"], event.reason))
    return tuple(marks)
