"""What is known of the lives of a machine's components: as JSON and in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.fold import plain
from evertwin.prognosis.component import ComponentLife, said
from evertwin.prognosis.laws import Indicator, Life, NotEnough
from evertwin.prognosis.laws.alarms import Alarm
from evertwin.types import Json

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
    def notes(self) -> tuple[str, ...]:
        """What may surprise in how the history was read."""
        told = (note for one in self.indicators for note in one.indicator.notes)
        return tuple(dict.fromkeys((*told, *self.left_out)))

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.life/1"``."""
        parts = {}
        for name, one in self.components.items():
            entry = entry_of(one.indicator, one.life, self.dates)
            parts[name] = entry | {
                "rate": one.rate, "age": one.age, "wear": one.wears.text, "phases": one.phases
            }  # fmt: skip
        content: dict[str, Any] = {
            "schema": SCHEMA, "components": parts,
            "name": self.name, "clock": self.clock, "now": self.now,
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
            lines.append(
                f"{name}: {one.indicator.name} {value}, limit "
                f"{one.indicator.shown(one.indicator.limit.value)} ({one.indicator.limit.source})\n"
                f"  {one.sentence}"
            )
            lines += [f"  {one.ahead}"] if one.ahead else []
        if self.machine is not None:
            lines.append(f"machine: {said(self.machine)}")
        lines += [f"! {alarm.reason}\n  {alarm.action}" for alarm in self.alarms]
        if self.held:
            lines.append(f"held back, over the budget of the day: {len(self.held)}")
        lines += [f"  {a.component}: {a.kind.replace('_', ' ')}: {a.reason}" for a in self.held]
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(lines) or "no [[indicator]] in the twin file"


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
