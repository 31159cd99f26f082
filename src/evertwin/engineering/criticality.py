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
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from evertwin.engineering.breakdown import Breakdown, Place
from evertwin.engineering.history import History, read_history
from evertwin.engineering.parts import Component, Role
from evertwin.errors import ConfigError, DataError, nearest


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
