"""What a twin file says, as frozen dataclasses. `Twin` can be built from them without a file.

Every section of the file is one class, every key one field; the JSON schema, the checks and the
reference page are generated from here. A quantity may be written as a number in SI or as text with
its unit (``"2 cm"``); its value is always SI.

>>> TwinSpec(name="robot", model=ModelSpec(kind="robot1d")).prediction.horizon
inf
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from evertwin.config.data import (
    Amount,
    ChannelSpec,
    ClockSpec,
    CropSpec,
    DeriveSpec,
    FilterSpec,
    MovingSpec,
    SignalSpec,
    SourceSpec,
    Spread,
    TimeSpec,
)
from evertwin.config.loop import (
    AnomalySpec,
    ArbiterSpec,
    CorrectionSpec,
    CutSpec,
    PredictionSpec,
    TrialSpec,
    TuningSpec,
)
from evertwin.config.prognosis import (
    AccuracySpec,
    CostSpec,
    IndicatorSpec,
    PrognosisSpec,
    WorkSpec,
)
from evertwin.settings.fields import Free, Hidden, Limits, Quantity, Section, Shorthand
from evertwin.types import Json

__all__ = [
    "SCHEMA",
    "AccuracySpec",
    "AnomalySpec",
    "ArbiterSpec",
    "ChannelSpec",
    "ClockSpec",
    "CorrectionSpec",
    "CostSpec",
    "CropSpec",
    "CutSpec",
    "DeriveSpec",
    "FilterSpec",
    "IndicatorSpec",
    "ModelSpec",
    "MovingSpec",
    "ParameterSpec",
    "PredictionSpec",
    "PrognosisSpec",
    "Quantity",
    "SignalSpec",
    "SourceSpec",
    "StoreSpec",
    "TimeSpec",
    "TrialSpec",
    "TuningSpec",
    "TwinSpec",
    "WorkSpec",
]

SCHEMA = 1
"""Version of the twin file that this evertwin reads."""


@dataclass(frozen=True)
class ParameterSpec(Section):
    """``[model.parameters.NAME]``: what differs from the model's own proposal.

    >>> ParameterSpec(value=1.0).editable is None
    True
    """

    shorthand = Shorthand("value")

    value: Amount | None = None
    """Start value."""
    unit: str | None = None
    """Unit of the bare numbers of this table; absent: SI."""
    low: Amount | None = None
    """Lower bound."""
    high: Amount | None = None
    """Upper bound."""
    sigma: Spread | None = None
    """Standard deviation of the prior around the value."""
    editable: bool | None = None
    """May tuning change it?"""
    source: str | None = None
    """Where the value comes from: data sheet, literature, experiment."""


@dataclass(frozen=True)
class ModelSpec(Section):
    """``[model]``: which model, with which options.

    >>> ModelSpec(kind="thermal").options
    {}
    """

    kind: str
    """Name of a built-in model or of an entry point in the group ``evertwin.models``."""
    options: Annotated[Mapping[str, Json], Free()] = field(default_factory=dict)
    """Keywords of the model's factory."""
    parameters: Mapping[str, ParameterSpec] = field(default_factory=dict)
    """Parameters by name; those not named stay as the model proposes them."""


@dataclass(frozen=True)
class StoreSpec(Section):
    """``[store]``: where versions, events and checkpoints are kept.

    >>> StoreSpec().path is None
    True
    """

    path: str | None = None
    """SQLite file, relative to the twin file; absent: in memory."""


@dataclass(frozen=True)
class TwinSpec(Section):
    """A whole twin file.

    >>> TwinSpec(name="box", model=ModelSpec(kind="thermal")).schema
    1
    """

    name: str
    """Name of the twin."""
    model: ModelSpec
    """Which model, with which options."""
    schema: int = SCHEMA
    """Version of the file's schema."""
    source: tuple[SourceSpec, ...] = ()
    """Recorded sources, one ``[[source]]`` each."""
    derive: tuple[DeriveSpec, ...] = ()
    """Channels computed from others, one ``[[derive]]`` each."""
    signals: Mapping[str, SignalSpec] = field(default_factory=dict)
    """The model's channels by name; those not named are recorded under their own names."""
    clock: ClockSpec = ClockSpec()
    """The rows."""
    filter: FilterSpec | None = None
    """The filter over measurement and prediction; absent: none."""
    moving: MovingSpec | None = None
    """Which rows count as moving; absent: all."""
    arbiter: ArbiterSpec = ArbiterSpec()
    """How measurements are judged."""
    prediction: PredictionSpec = PredictionSpec()
    """Over which horizon models are compared and tuned."""
    anomaly: AnomalySpec = AnomalySpec()
    """When the twin is suspected to differ from its machine."""
    tuning: TuningSpec = TuningSpec()
    """Which parameters, how, when."""
    correction: CorrectionSpec = CorrectionSpec()
    """How the model's form may be corrected."""
    trial: TrialSpec = TrialSpec()
    """The gate to the live model."""
    store: StoreSpec = StoreSpec()
    """Where versions, events and checkpoints are kept."""
    indicator: tuple[IndicatorSpec, ...] = ()
    """What tells wear, one ``[[indicator]]`` each."""
    prognosis: PrognosisSpec = PrognosisSpec()
    """How lives are counted and maintenance is planned."""
    work: tuple[WorkSpec, ...] = ()
    """The work that lies ahead, one ``[[work]]`` each; absent: as it was."""
    beat: Annotated[int, Limits(at_least=1)] = 100
    """Rows from decision to decision."""
    folder: Annotated[str, Hidden()] = field(default=".", compare=False)
    """Folder of the twin file; set when it is read."""
