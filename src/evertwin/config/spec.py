"""What a twin file says, as frozen dataclasses. `Twin` can be built from them without a file.

Every section of the file is one class, every key one field; the JSON schema, the checks and the
reference page are generated from here. A quantity may be written as a number in SI or as text with
its unit (``"2 cm"``); ``Quantity("m")`` says which kind is expected, ``Quantity()`` takes the unit
of the channel that it is about.

>>> TwinSpec(name="robot", model=ModelSpec(kind="robot1d")).prediction.horizon
inf
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple, TypeAlias

from evertwin.types import Json

__all__ = [
    "AnomalySpec",
    "ArbiterSpec",
    "ChannelSpec",
    "ClockSpec",
    "CorrectionSpec",
    "CropSpec",
    "DeriveSpec",
    "FilterSpec",
    "ModelSpec",
    "MovingSpec",
    "ParameterSpec",
    "PredictionSpec",
    "Quantity",
    "SignalSpec",
    "SourceSpec",
    "StoreSpec",
    "TimeSpec",
    "TrialSpec",
    "TuningSpec",
    "TwinSpec",
]


class Quantity(NamedTuple):
    """Marks a number that may be written with a unit.

    >>> Quantity("s").unit
    's'
    """

    unit: str = ""


Column: TypeAlias = str | int
Seconds: TypeAlias = Annotated[float, Quantity("s")]
Hertz: TypeAlias = Annotated[float, Quantity("Hz")]
Amount: TypeAlias = Annotated[float, Quantity()]


@dataclass(frozen=True)
class ParameterSpec:
    """``[model.parameters.NAME]``: what differs from the model's own proposal.

    >>> ParameterSpec(value=1.0).editable is None
    True
    """

    value: Amount | None = None
    unit: str | None = None
    low: Amount | None = None
    high: Amount | None = None
    sigma: Amount | None = None
    """Standard deviation of the prior around the value."""
    editable: bool | None = None
    """May tuning change it?"""
    source: str | None = None
    """Where the value comes from."""


@dataclass(frozen=True)
class ModelSpec:
    """``[model]``: which model, with which options.

    >>> ModelSpec(kind="thermal").options
    {}
    """

    kind: str
    """Name of a built-in model or of an entry point in the group ``evertwin.models``."""
    options: Mapping[str, Json] = field(default_factory=dict)
    """Keywords of the model's factory."""
    parameters: Mapping[str, ParameterSpec] = field(default_factory=dict)


@dataclass(frozen=True)
class ChannelSpec:
    """``[source.channels]``: one channel of a source.

    >>> ChannelSpec(column="v", unit="cm/s").scale
    1.0
    """

    column: Column
    """Name in the header, or position from 0."""
    unit: str
    """Unit in the file."""
    scale: float = 1.0
    """Multiplies the file's value before its unit is converted."""
    offset: float = 0.0
    """Added after ``scale``, in the file's unit."""
    sentinels: tuple[float, ...] = ()
    """Values of the file that mean "no value"."""


@dataclass(frozen=True)
class TimeSpec:
    """``time``: where a source's stamps come from.

    >>> TimeSpec(column="t").unit
    's'
    """

    column: Column | None = None
    """Name in the header, or position from 0; absent: ``rate``."""
    unit: Literal["s", "ms", "us", "ns", "min", "h", "iso"] = "s"
    rate: Hertz | None = None
    """Rate of a recording without time column."""


@dataclass(frozen=True)
class SourceSpec:
    """``[[source]]``: one recorded source.

    >>> SourceSpec(name="log", channels={}).format
    'auto'
    """

    name: str
    channels: Mapping[str, ChannelSpec]
    files: tuple[str, ...] = ()
    """Recordings, each a task; relative to the twin file."""
    match: str = "*"
    """Which files given on the command line belong to this source (file name pattern)."""
    format: Literal["auto", "csv", "text", "mat", "parquet", "mcap", "bag", "numpy"] = "auto"
    header: bool | None = None
    delimiter: str = "auto"
    decimal: Literal[".", ","] = "."
    time: TimeSpec = TimeSpec(column=0)
    task: Column | None = None
    """Column whose change opens a new task."""
    where: Mapping[str, tuple[float | str, ...]] = field(default_factory=dict)
    """Only rows whose column has one of these values."""
    offset: Seconds = 0.0
    """Known offset of the source's clock, added to its stamps."""


@dataclass(frozen=True)
class DeriveSpec:
    """``[[derive]]``: a channel computed from others, per task.

    >>> DeriveSpec(name="qdd1", op="derivative", source=("qd1",)).op
    'derivative'
    """

    name: str
    op: Literal["derivative", "filter", "sum", "mean", "difference", "product", "scale", "norm", "max"]
    source: tuple[str, ...]
    unit: str | None = None
    value: float = 1.0
    """Factor of ``scale``."""


@dataclass(frozen=True)
class SignalSpec:
    """``[signals.NAME]``: a channel of the model.

    >>> SignalSpec(source="v_cmd").low is None
    True
    """

    source: str | None = None
    """Recorded or derived channel, when it is called otherwise."""
    low: Amount | None = None
    high: Amount | None = None
    rate: Amount | None = None
    """Largest possible change per second."""
    hold: bool = True
    """Inputs: hold the last value between samples (else interpolate)."""


@dataclass(frozen=True)
class CropSpec:
    """``[clock.crop]``: keeps each task from the first to the last motion.

    >>> CropSpec(channels=("qd1",), above=0.02).inside
    0.0
    """

    channels: tuple[str, ...]
    above: Amount
    """Smallest absolute value, of any of the channels, that counts as motion."""
    inside: Seconds = 0.0
    """Left out at both ends."""


@dataclass(frozen=True)
class ClockSpec:
    """``[clock]``: the rows.

    >>> ClockSpec().rate is None
    True
    """

    rate: Hertz | None = None
    """Resample each task onto a uniform grid; absent: the union of the stamps."""
    slack: Seconds = 0.0
    """How long a row waits for late samples."""
    gap: Seconds = math.inf
    """Longest interval that is simulated over."""
    start: Seconds = -math.inf
    """Leave out what lies before, from the start of each task."""
    stop: Seconds = math.inf
    """Leave out what lies after."""
    crop: CropSpec | None = None


@dataclass(frozen=True)
class FilterSpec:
    """``[filter]``: the one filter that goes over measurement and prediction alike.

    >>> FilterSpec(cutoff=5.0).order
    4
    """

    kind: Literal["butterworth", "savgol"] = "butterworth"
    """``butterworth``: zero-phase over a task; ``savgol``: symmetric, in the stream."""
    order: int = 4
    cutoff: Hertz = 5.0
    """For ``savgol``: the window is the odd number of rows nearest to rate / cutoff."""
    inputs: tuple[str, ...] = ()
    """Recorded channels that are filtered too, before derivatives are taken."""


@dataclass(frozen=True)
class MovingSpec:
    """``[moving]``: which rows count as moving, per output.

    >>> MovingSpec(above=0.05).channels
    {}
    """

    above: Amount
    channels: Mapping[str, str] = field(default_factory=dict)
    """Output → input channel whose absolute value decides."""


@dataclass(frozen=True)
class ArbiterSpec:
    """``[arbiter]`` and ``[arbiter.groups.NAME]``: how measurements are judged.

    >>> ArbiterSpec().vote
    8
    """

    gate: float = 4.0
    """Innovation gate in standard deviations."""
    vote: int = 8
    """Samples of a group in the vote; longer than the longest credible burst."""
    use: Literal["none", "tolerance", "blend"] = "none"
    """What happens with a trusted measurement."""
    tolerance: Amount = math.inf
    """``tolerance``: adopt it when it differs by more."""
    sigma: Amount = 0.0
    """Standard deviation of the measurement; 0: learned from the residuals."""
    growth: Amount = 0.0
    """Growth of the prediction's standard deviation per √s while it predicts; 0: learned."""
    frozen: int = 5
    """Equal values in a row, while motion is predicted, that make a sensor frozen; 0: never."""
    timeout: Seconds = math.inf
    """Without a trusted measurement for this long, the state is shown as not valid."""
    groups: Mapping[str, ArbiterSpec] = field(default_factory=dict)


@dataclass(frozen=True)
class PredictionSpec:
    """``[prediction]``: over which horizon models are compared and tuned.

    >>> PredictionSpec().horizon
    inf
    """

    horizon: Seconds = math.inf
    """Predictions restart from the measured state after this time; inf: once a task."""
    scale: Mapping[str, Amount] = field(default_factory=dict)
    """Output → size that counts as 1 in a loss; default: the rms of its first residuals."""


@dataclass(frozen=True)
class AnomalySpec:
    """``[anomaly]``: when the twin is suspected to differ from its machine.

    >>> AnomalySpec(requirement=0.05).relative
    True
    """

    requirement: Amount = math.inf
    """Largest deviation: relative to the rms of the measurement, or in the output's unit."""
    relative: bool = True
    snr: float = 0.0
    """Signal-to-noise threshold; 0: not used."""
    false_alarms_per_month: float = 1.0
    calibration: Seconds = math.inf
    """Calm data that sets the run-length limits; inf: the first task."""
    phases: tuple[str, ...] = ()
    """Channels whose values define the phase."""
    outputs: tuple[str, ...] = ()
    """Outputs that are watched; default: all."""
    window: int = 600
    """Rows over which the requirement is judged (or the task, where tasks end earlier)."""


@dataclass(frozen=True)
class TuningSpec:
    """``[tuning]``: which parameters, how, when.

    >>> TuningSpec().method
    'auto'
    """

    editable: tuple[str, ...] | None = None
    """Default: what the model proposes. ``*`` matches any text."""
    method: Literal["auto", "recursive", "iteration"] = "auto"
    """``auto``: solved at once; ``recursive``: in the stream; ``iteration``: relaxed rounds."""
    every: Seconds = math.inf
    """Also tune on a schedule, not only when suspected."""
    window: int = 6000
    """Newest rows that a fit looks at."""
    loss: Literal["linear", "soft_l1", "huber"] = "linear"
    weights: Mapping[str, float] = field(default_factory=dict)
    """Parameter → how often it is tuned, relative to the others."""
    ladder: tuple[str, ...] = ()
    """Variants of the model, simplest first, climbed while held-out error falls."""
    causes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Cause → its parameters; competing refits name the cause of a deviation."""
    relaxation: float = 0.4
    """Step of the iteration mode."""


@dataclass(frozen=True)
class CorrectionSpec:
    """``[correction]``: how the model's form may be corrected.

    >>> CorrectionSpec().terms
    ()
    """

    channels: tuple[str, ...] = ()
    """Inputs (or states, for ``state``) that may be corrected."""
    terms: tuple[Literal["lag", "table", "law", "coupling", "surface", "state"], ...] = ()
    """Kinds of term that may be tried; empty: the form stays."""
    learner: Literal["full", "replay", "literal"] = "full"
    """How a table is learned."""
    quantum: Amount = 0.0
    """Step of a table's levels; 0: proposed from the data."""
    refine: bool = True
    """Replace a table by a continuous law where that predicts better."""
    watch: tuple[str, ...] = ()
    """Inputs for which the table was learned; when they change a new training sequence starts."""
    window: int = 6000
    """Newest rows that a correction is learned on."""


@dataclass(frozen=True)
class TrialSpec:
    """``[trial]``: the gate to the live model. One set of settings serves all machines.

    >>> TrialSpec().alpha
    0.01
    """

    alpha: float = 0.01
    """Chance of promoting a challenger that is no better."""
    margin: float = 0.05
    """Smallest relative gain on unseen data."""
    segments: int = 10
    """Fewest segments."""
    limit: int = 2000
    """Segments after which a trial ends without promotion."""
    probation: int = 30
    """Segments after a promotion during which the old champion runs along."""
    holdoff: int = 100
    """Rows after a rejection or roll-back before the next candidate."""


@dataclass(frozen=True)
class StoreSpec:
    """``[store]``: where versions, events and checkpoints are kept.

    >>> StoreSpec().path is None
    True
    """

    path: str | None = None
    """SQLite file, relative to the twin file; absent: in memory."""


@dataclass(frozen=True)
class TwinSpec:
    """A whole twin file.

    >>> TwinSpec(name="box", model=ModelSpec(kind="thermal")).schema
    1
    """

    name: str
    model: ModelSpec
    schema: int = 1
    """Version of the file's schema."""
    source: tuple[SourceSpec, ...] = ()
    derive: tuple[DeriveSpec, ...] = ()
    signals: Mapping[str, SignalSpec] = field(default_factory=dict)
    clock: ClockSpec = ClockSpec()
    filter: FilterSpec | None = None
    moving: MovingSpec | None = None
    arbiter: ArbiterSpec = ArbiterSpec()
    prediction: PredictionSpec = PredictionSpec()
    anomaly: AnomalySpec = AnomalySpec()
    tuning: TuningSpec = TuningSpec()
    correction: CorrectionSpec = CorrectionSpec()
    trial: TrialSpec = TrialSpec()
    store: StoreSpec = StoreSpec()
    beat: int = 100
    """Rows from decision to decision."""
    folder: str = "."
    """Folder of the twin file; set when it is read."""
