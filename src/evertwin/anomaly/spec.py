"""Settings of suspicion: when the twin is said to differ from its machine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from annotated_types import Ge, Le

from evertwin.errors import UsageError
from evertwin.fold.span import Span
from evertwin.settings.kinds import Duration, Positive, Seconds, Size
from evertwin.settings.notes import Rows, expand
from evertwin.settings.quantity import written
from evertwin.settings.section import Section
from evertwin.signals.units import si_unit


@dataclass(frozen=True)
class StepsSpec(Section):
    """``[anomaly.steps]``: a task that repeats, in equal steps with limits of their own.

    >>> StepsSpec(duration=69.0, parts=6).parts
    6
    """

    duration: Duration
    """How long one task takes; rows after it belong to the last step."""
    parts: Annotated[int, Ge(1), Le(1000)]
    """Number of steps."""


PHASES = 1_000
"""Each phase keeps statistics of its own."""


@dataclass(frozen=True)
class AnomalySpec(Section):
    """``[anomaly]``: when the twin is suspected to differ from its machine.

    >>> AnomalySpec(requirement=0.05).relative
    True
    """

    requirement: Size = math.inf
    """Largest deviation: a share of the output's rms (of a temperature's range), or in its unit."""
    relative: bool = True
    """Is ``requirement`` a share? By default true for a bare number, false with a unit."""
    unit: str = ""
    """Of ``requirement``, whose text says it; outputs that are watched must measure the same."""
    snr: Annotated[float, Ge(0.0)] = 0.0
    """Signal-to-noise threshold; 0: not used."""
    false_alarms_per_month: Positive = 1.0
    """Over all outputs together; sets the detectors' limits."""
    calibration: Annotated[Seconds, Ge(0.0)] = 0.0
    """Calm data that sets the run-length limits; 0: as soon as it suffices; inf: the whole first
    task, and further ones only if it does not suffice."""
    phases: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Input to the borders (SI, rising) that divide its range: each regime has its own limits."""
    steps: StepsSpec | None = None
    """Each task is the same work: each step of it has its own limits, beside ``phases``."""
    external: Annotated[Seconds, Ge(0.0), Le(3600.0)] = 5.0
    """Longest that something outside acts on the machine, a contact or a push; 0: none is told."""
    outputs: tuple[str, ...] = ()
    """Outputs that are watched; empty: all."""
    window: Annotated[Span, Rows()] = Span(600)
    """Rows, or time, that the requirement is judged over (the task, where it ends earlier)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        count = math.prod(len(borders) + 1 for borders in self.phases.values())
        if count > PHASES:
            raise UsageError(
                f"phases: expected borders that make at most {PHASES} phases, got {count}"
            )

    @classmethod
    def prepare(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        """A requirement with a unit is absolute: "2 cm", or "6 deg", is a share of nothing."""
        value = table.get("requirement")
        try:
            unit = written(expand(value))[1] if isinstance(value, str) else ""
        except UsageError:  # told of the setting itself
            return table
        if not unit or si_unit(unit) == "1":
            return table
        if table.get("relative") is True:
            raise UsageError(f"requirement {value!r} has a unit, so it is not relative")
        return {"relative": False, "unit": unit, **table}
