"""Where the data comes from and what is done to it before the loop sees it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

from evertwin.errors import UsageError
from evertwin.settings.fields import Key, Late, Limits, Quantity, Section, Shorthand
from evertwin.signals.units import conversion

__all__ = [
    "Amount",
    "ChannelSpec",
    "ClockSpec",
    "Column",
    "CropSpec",
    "DeriveSpec",
    "FilterSpec",
    "Hertz",
    "MovingSpec",
    "Seconds",
    "SignalSpec",
    "SourceSpec",
    "Spread",
    "TimeSpec",
]

Column: TypeAlias = str | Annotated[int, Limits(at_least=0)]
Seconds: TypeAlias = Annotated[float, Quantity("s", difference=True)]
Hertz: TypeAlias = Annotated[float, Quantity("Hz"), Limits(above=0.0)]
Amount: TypeAlias = Annotated[float, Quantity()]
Spread: TypeAlias = Annotated[float, Quantity(difference=True), Limits(at_least=0.0)]


@dataclass(frozen=True)
class ChannelSpec(Section):
    """``[source.channels]``: one channel of a source.

    >>> ChannelSpec(column="v", unit="cm/s").scale
    1.0
    """

    column: Column
    """Name in the header, or position from 0."""
    unit: str
    """Unit in the file; "1" for a pure number."""
    scale: float = 1.0
    """Multiplies the file's value before its unit is converted (a motor constant, a sign)."""
    offset: float = 0.0
    """Added after ``scale``, in the file's unit."""
    sentinels: tuple[float, ...] = ()
    """Values of the file that mean "no value"."""

    def __post_init__(self) -> None:
        super().__post_init__()
        conversion(self.unit)
        if self.scale == 0.0:
            raise UsageError("scale: expected a factor other than 0: it would erase the channel")


@dataclass(frozen=True)
class TimeSpec(Section):
    """``time``: where a source's stamps come from.

    >>> TimeSpec(column="t").unit
    's'
    """

    shorthand = Shorthand("column")

    column: Column | None = None
    """Name in the header, or position from 0; absent: ``rate``."""
    unit: Literal["s", "ms", "us", "ns", "min", "h", "iso", "auto"] = "s"
    """Unit of the stamps; ``iso`` for dates as text; ``auto``: told from each file's stamps."""
    rate: Hertz | None = None
    """Rate of a recording without time column."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.column is None) == (self.rate is None):
            raise UsageError(
                "expected either a column with stamps or a rate, as in "
                "{ column = 't', unit = 's' } or { rate = '100 Hz' }"
            )


@dataclass(frozen=True)
class SourceSpec(Section):
    """``[[source]]``: one recorded source.

    >>> SourceSpec(name="log", channels={}).format
    'auto'
    """

    name: str
    """Name in messages."""
    channels: Mapping[str, ChannelSpec]
    """Channel name to its column: ``v = { column = "v", unit = "m/s" }``."""
    files: tuple[Annotated[str, Late()], ...] = ()
    """Recordings or patterns, each file a task; relative to the twin file. ``--data`` replaces
    them."""
    match: str = "*"
    """Which files given with ``--data`` belong to this source (file name pattern)."""
    format: Literal["auto", "csv", "text", "mat", "parquet", "mcap", "bag", "numpy"] = "auto"
    """Kind of the files, others are refused; ``auto``: any, told from the content."""
    header: bool | None = None
    """Does a table open with headings? Absent: found from its first lines."""
    delimiter: str = "auto"
    """Sign between the cells of a table, ``tab``, ``blank`` for runs of blanks, or ``auto``."""
    decimal: Literal["auto", ".", ","] = "auto"
    """Decimal sign of a table; ``auto``: found from its first lines."""
    time: TimeSpec = TimeSpec(column=0)
    """Where the stamps come from."""
    task: Column | None = None
    """Column whose change opens a new task."""
    where: Mapping[str, tuple[float | str, ...]] = field(default_factory=dict)
    """Only rows whose column has one of these values."""
    offset: Seconds = 0.0
    """Known offset of the source's clock, added to its stamps."""


@dataclass(frozen=True)
class DeriveSpec(Section):
    """``[[derive]]``: a channel computed from others, per task, in the order written.

    >>> DeriveSpec(name="qdd1", op="derivative", source=("qd1",)).op
    'derivative'
    """

    name: str
    """Name of the new channel."""
    op: Literal[
        "derivative", "filter", "sum", "mean", "difference", "product", "scale", "norm", "max",
        "along", "way", "middle", "slope",
    ]  # fmt: skip
    """What is computed. ``middle``: the mean over the interval into the row (of the row and the one
    before). ``slope``: the derivative of a cubic through the rows within ``value`` seconds
    (Savitzky-Golay; one-sided at the ends). From x, y and heading of a base: ``along``, the way
    along its heading; ``way``, the length of its path, negative for a task that went backwards."""
    source: Annotated[tuple[str, ...], Key("from")]
    """Recorded or derived channels it is computed from."""
    unit: str | None = None
    """SI unit of the new channel; absent: what follows from the operation."""
    value: float = 1.0
    """Factor of ``scale``; seconds of ``slope``."""


@dataclass(frozen=True)
class SignalSpec(Section):
    """``[signals.NAME]``: a channel of the model.

    >>> SignalSpec(source="v_cmd").low is None
    True
    """

    shorthand = Shorthand("from")

    source: Annotated[str | None, Key("from")] = None
    """Recorded or derived channel, when it is called otherwise."""
    low: Amount | None = None
    """Smallest physically possible value."""
    high: Amount | None = None
    """Largest physically possible value."""
    rate: Spread | None = None
    """Largest possible change per second."""
    hold: bool | None = None
    """Inputs: a command, held from its stamp on (true), or measured at the row and interpolated
    (false). Absent: held for a model with states, measured for a static map."""
    judge: bool = True
    """Outputs: false for one that a prediction of a fit starts from, but is not compared with."""
    measured: bool = True
    """Outputs: false for a virtual sensor, which the model computes and nothing records."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise UsageError(f"expected low < high, got {self.low:g} and {self.high:g} in SI")


@dataclass(frozen=True)
class CropSpec(Section):
    """``[clock.crop]``: keeps each task from the first to the last motion.

    >>> CropSpec(channels=("qd1",), above=0.02).inside
    0.0
    """

    channels: tuple[str, ...]
    """Channels that show motion."""
    above: Annotated[float, Quantity(), Limits(at_least=0.0)]
    """Smallest absolute value, of any of the channels, that counts as motion."""
    inside: Annotated[Seconds, Limits(at_least=0.0)] = 0.0
    """Left out at both ends."""


@dataclass(frozen=True)
class ClockSpec(Section):
    """``[clock]``: the rows.

    >>> ClockSpec().rate is None
    True
    """

    rate: Hertz | None = None
    """Resample each task onto a uniform grid; absent: the union of the stamps."""
    gap: Annotated[Seconds, Limits(above=0.0)] = math.inf
    """Longest interval that is simulated over."""
    start: Seconds = -math.inf
    """Leave out what lies before, from the start of each task."""
    stop: Seconds = math.inf
    """Leave out what lies after."""
    crop: CropSpec | None = None
    """Keep each task from the first to the last motion; absent: all of it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start >= self.stop:
            raise UsageError(f"expected start < stop, got {self.start:g} s and {self.stop:g} s")


@dataclass(frozen=True)
class FilterSpec(Section):
    """``[filter]``: the one filter that goes over measurement and prediction alike.

    >>> FilterSpec(cutoff=5.0).order
    4
    """

    kind: Literal["butterworth", "savgol"] = "butterworth"
    """``butterworth``: zero-phase over a task; ``savgol``: symmetric, in the stream."""
    order: Annotated[int, Limits(at_least=1, at_most=12)] = 4
    """Order of the filter, or of the polynomial of ``savgol``."""
    cutoff: Hertz = 5.0
    """Cut-off frequency; ``savgol``: the window is the odd number of rows nearest to
    rate / cutoff."""
    inputs: tuple[str, ...] = ()
    """Recorded channels that are filtered too, before derivatives are taken."""


@dataclass(frozen=True)
class MovingSpec(Section):
    """``[moving]``: which rows count as moving, per output.

    >>> MovingSpec(above=0.05).channels
    {}
    """

    above: Annotated[float, Quantity(), Limits(at_least=0.0)]
    """Moving where the deciding channel's absolute value exceeds this."""
    channels: Mapping[str, str] = field(default_factory=dict)
    """Output to the input channel that decides for it."""
    tune: bool = False
    """Tune on moving rows only: for friction, which at standstill is not determined."""
