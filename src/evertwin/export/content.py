"""What is exported: a version's form and parameters with what is known of them, and trajectories.

>>> Exported.__name__
'Exported'
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evertwin.fold import Block, Event
from evertwin.ledger.versions import Versions
from evertwin.models import Model
from evertwin.models.form import Version
from evertwin.refit.recordings.screening import screened
from evertwin.rows.feed import Feed
from evertwin.setup.evaluation import predict
from evertwin.setup.setup import Setup
from evertwin.signals import Layout
from evertwin.store import Estimate, Store
from evertwin.sync.horizon.horizon import trusted
from evertwin.types import Inputs, Outputs, Vector


@dataclass(frozen=True)
class Trajectories:
    """Rows of recordings with what the version predicts of them.

    >>> Trajectories.__name__
    'Trajectories'
    """

    t: Vector
    """Seconds from the first row, (n,)."""
    task: np.ndarray
    """Number of the recording, (n,)."""
    inputs: Inputs
    measured: Outputs
    """NaN where not measured or not trusted, (n, ny)."""
    predicted: Outputs
    """From the measured state over the twin's horizon, (n, ny); NaN where nothing is predicted.

    Both sides filtered as the twin file says."""


@dataclass(frozen=True)
class Exported:
    """One version of one twin. Built by `exported`.

    >>> Exported.__name__
    'Exported'
    """

    name: str
    kind: str
    """Of the model, as in the twin file."""
    options: Mapping[str, Any]
    folder: str
    """What file names in ``options`` are relative to."""
    version: Version
    model: Model
    """The model of the version's form, with the values as configured."""
    base: Model
    """The model without terms."""
    known: Mapping[str, Estimate]
    """The newest estimate of the parameters whose value is that of the version."""
    trajectories: Trajectories | None = None
    alarms: tuple[Event, ...] = ()
    """The newest of each component that no later event has cleared."""
    recorded: Callable[[], tuple[Block, ...]] = tuple
    """The rows of the recordings given, else of those that the twin file names.

    Raises:
        DataError: they cannot be read."""

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """Value, unit, bounds, interval and verdict of every parameter."""
        names = zip(self.version.names, self.version.values, strict=True)
        return {name: self._parameter(name, float(value)) for name, value in names}

    def _parameter(self, name: str, value: float) -> dict[str, Any]:
        item, known = self.model.parameters[name], self.known.get(name)
        return {
            "value": value, "unit": item.unit, "low": item.low, "high": item.high,
            "as_configured": item.value, "source": "tuned" if known else item.source,
            "interval95": None if known is None else (known.low, known.high),
            "verdict": "not tuned" if known is None else known.verdict,
        }  # fmt: skip

    def channels(self, layout: Layout) -> list[dict[str, str]]:
        """Name and unit of each channel."""
        return [{"name": c.name, "unit": c.unit} for c in layout]


def exported(
    setup: Setup, versions: Versions, store: Store, number: int, windows: tuple[Block, ...]
) -> Exported:
    """Everything about version ``number``; ``windows`` become trajectories."""
    version, spec = versions[number], setup.spec
    values = dict(zip(version.names, version.values, strict=True))
    known: dict[str, Estimate] = {}
    for record in store.read("estimate"):
        if isinstance(record, Estimate) and values.get(record.name) == record.value:
            known[record.name] = record
    model = versions.model(number)
    rows = _trajectories(setup, model, version, windows) if windows else None
    alarms: dict[str, Event] = {}
    for event in store.read("event"):
        if isinstance(event, Event) and event.kind in ("alarm", "alarm_cleared"):
            alarms[event.signal] = event

    def recorded() -> tuple[Block, ...]:
        told = windows or (
            Feed(spec, model).blocks() if any(one.files for one in spec.source) else ()
        )
        return screened(setup, model, version.p, told).rows

    open_ones = tuple(one for one in alarms.values() if one.kind == "alarm")
    return Exported(
        spec.name, spec.model.kind, dict(spec.model.options), str(spec.folder), version, model,
        setup.model, known, rows, open_ones, recorded,
    )  # fmt: skip


def _trajectories(
    setup: Setup, model: Model, version: Version, windows: tuple[Block, ...]
) -> Trajectories:
    found = [predict(setup, model, version.p, window) for window in windows]
    origin, filtered = windows[0].t[0], setup.smooth_window is not None
    return Trajectories(
        np.concatenate([(w.t - origin) * 1e-9 for w in windows]),
        np.concatenate([w.task for w in windows]),
        np.concatenate([w.u for w in windows]),
        np.concatenate([one.measured if filtered else trusted(one.window) for one in found]),
        np.concatenate([one.predicted for one in found]),
    )
