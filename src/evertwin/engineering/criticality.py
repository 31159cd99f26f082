"""Which components are critical: effect on health × proneness to failure, ranked, with reasons.

>>> from evertwin.engineering.breakdown import BREAKDOWN
>>> found = BREAKDOWN.parse('''
... schema = 1
... name = "pump"
... [[system]]
... name = "hydraulic"
... component = [
...     { name = "filter", effect = 2, proneness = 5 },
...     { name = "seal", effect = 5, proneness = 4 },
...     { name = "hose", effect = 2, proneness = 2 },
... ]
... ''')
>>> [(one.component, one.score, one.role) for one in rank(found)]
[('seal', 20.0, 'critical'), ('filter', 10.0, 'critical'), ('hose', 4.0, 'supporting')]

Proneness to failure from a maintenance history: how often, and how long the machine stood.

A history is a CSV with one line for each failure:

    date,component,downtime [h]
    2024-03-05,gearbox 3,6.5

The grade counts in factors of four, so that it says the same as the words of `evertwin.engineering.
parts`: a failure every four years is 3, every year 4, four times a year 5. Standing still counts
alike, with a shift of eight hours a year for 4. The larger of both is taken.

>>> history = History({"seal": (2, 8.0 * 3600.0)}, 4 * YEAR)
>>> history.grade("seal"), history.grade("pump")
(3.5, 1.0)
>>> history.reason("seal")
'2 failures in 4 years, 8 h of downtime'
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evertwin.engineering.breakdown import Breakdown, Place
from evertwin.engineering.parts import Component, Role
from evertwin.errors import ConfigError, DataError, nearest
from evertwin.sources.texts.small_table import read_table
from evertwin.types import Vector

YEAR = 365.25 * 86400.0
"""[s]"""
SHIFT = 8.0 * 3600.0
"""Downtime a year that counts as one failure a year [s]."""
FACTOR = 4.0


@dataclass(frozen=True)
class History:
    """Failures of a machine's components. See the module for an example."""

    found: Mapping[str, tuple[int, float]]
    """Component → failures and downtime [s]."""
    span: float
    """Time that it covers [s]."""

    def grade(self, component: str) -> float:
        """Proneness to failure, 1 to 5."""
        failures, downtime = self.found.get(component, (0, 0.0))
        if not failures:
            return 1.0
        yearly = max(failures, downtime / SHIFT) * YEAR / self.span
        return min(max(4.0 + math.log(yearly, FACTOR), 1.0), 5.0)

    def reason(self, component: str) -> str:
        """What the grade rests on."""
        failures, downtime = self.found.get(component, (0, 0.0))
        years = f"{self.span / YEAR:.3g} years"
        if not failures:
            return f"no failure in {years}"
        times = "1 failure" if failures == 1 else f"{failures} failures"
        return f"{times} in {years}, {downtime / 3600.0:.3g} h of downtime"


def read_history(path: Path, span: float | None = None) -> History:
    """The history in a CSV file.

    Args:
        span: time that it covers [s]; None: from the first entry to the last.

    Raises:
        DataError: it cannot be read, a column is missing, or a line is not as it should be.
    """
    table = read_table(path)
    there = (*table.names, *table.text)
    for name in ("component", "downtime", *(("date",) if span is None else ())):
        if name not in there:
            raise DataError(
                f"{path}:1: expected the columns date, component, downtime [h], got "
                f"{', '.join(there)}"
            )
    downtime = table.column("downtime") * (1.0 if "downtime" in table.units else 3600.0)
    found: dict[str, tuple[int, float]] = {}
    for line, name, seconds in zip(table.lines, table.text.get("component", ()), downtime.tolist()):
        if not seconds >= 0.0:
            raise DataError(
                f"{path}:{line}: downtime: expected 0 or more, got {seconds / 3600:g} h"
            )
        count, so_far = found.get(name, (0, 0.0))
        found[name] = count + 1, so_far + seconds
    return History(found, _span(path, table.column("date")) if span is None else span)


def _span(path: Path, days: Vector) -> float:
    covered = float(np.nanmax(days) - np.nanmin(days))
    if not covered >= 30 * 86400.0:
        raise DataError(
            f"{path}: covers {covered / 86400.0:.0f} days: say how long it covers, "
            "history_span = '5 year'"
        )
    return covered


@dataclass(frozen=True)
class Criticality:
    """How critical one component is.

    >>> Criticality.__name__
    'Criticality'
    """

    component: str
    system: str
    subsystem: str
    effect: float
    proneness: float
    score: float
    """Effect × proneness, 1 to 25."""
    role: Role
    """What counts: computed, stated in the file, or overridden."""
    computed: Role
    """From the score alone."""
    reasons: tuple[str, ...]
    overridden: str = ""
    """The engineer's reason; empty: not overridden."""


def history_of(breakdown: Breakdown) -> History | None:
    """The maintenance history that the file names; None without one.

    Raises:
        DataError: it cannot be read, or names a component that the breakdown does not have.
    """
    if breakdown.history is None:
        return None
    path = Path(breakdown.folder) / breakdown.history
    history = read_history(path, breakdown.history_span)
    names = [component.name for component in breakdown.components]
    for name in history.found:
        if name not in names:
            hint = nearest(name, names)
            raise DataError(f"{path}: no component {name!r} in {breakdown.name}, {hint}")
    return history


def rank(breakdown: Breakdown, history: History | None = None) -> tuple[Criticality, ...]:
    """The components of the study, most critical first.

    Raises:
        ConfigError: a component has no grade of proneness, and there is no history.
    """
    found = [_judged(breakdown, place, history) for place in breakdown.studied]
    return tuple(sorted(found, key=lambda one: -one.score))


def _judged(breakdown: Breakdown, place: Place, history: History | None) -> Criticality:
    part = place.component
    proneness, why = _proneness(part, history)
    score = part.effect * proneness
    border = breakdown.critical_from
    computed: Role = "critical" if score >= border else "supporting"
    reasons = [
        f"effect on health {part.effect:g}"
        + (f": {part.effect_reason}" * bool(part.effect_reason)),
        f"proneness to failure {proneness:.2g}" + (f": {why}" if why else ""),
        f"{part.effect:g} × {proneness:.2g} = {score:.3g}, {computed} "
        f"({'from' if computed == 'critical' else 'below'} {border:g})",
    ]
    role = part.role or computed
    if part.role is not None and part.role != computed:
        reasons.append(f"the file states it as {part.role}")
    override = part.override
    if override is not None and override.role is not None:
        role = override.role
        reasons.append(f"overridden to {role}: {override.reason}")
    return Criticality(
        part.name, place.system, place.subsystem, part.effect, proneness, score, role, computed,
        tuple(reasons), override.reason if override is not None and override.role else "",
    )  # fmt: skip


def _proneness(part: Component, history: History | None) -> tuple[float, str]:
    """An expert's grade goes before the history."""
    if part.proneness is not None:
        return part.proneness, part.proneness_reason or "expert's grade"
    if history is None:
        raise ConfigError(
            f"component {part.name!r}: expected proneness = 1 to 5, or a maintenance history "
            "(history = 'FILE.csv')"
        )
    return history.grade(part.name), f"history: {history.reason(part.name)}"
