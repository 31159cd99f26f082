"""Settings of recorded sources: which files, and which column is which channel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

from annotated_types import Ge, Le

from evertwin.errors import UsageError
from evertwin.settings.kinds import Duration, Finite, Hertz, Seconds
from evertwin.settings.notes import Late, Shorthand
from evertwin.settings.section import Section
from evertwin.signals.units import conversion
from evertwin.sources.clocks.tally import LIMIT

Column: TypeAlias = str | Annotated[int, Ge(0), Le(1_000_000)]


@dataclass(frozen=True)
class ChannelSpec(Section):
    """``[source.channels]``: one channel of a source.

    >>> ChannelSpec(column="v", unit="cm/s").scale
    1.0
    """

    column: Column
    """Name in the header, or position from 0."""
    unit: str
    """Unit in the file; "1" for a pure number.
    With ``scale`` that of the file's value times ``scale``."""
    scale: Finite = 1.0
    """Multiplies the file's value before its unit is converted (a sign; of a current in A
    that drives a force in N, how many N one ampere is, with ``unit = "N"``)."""
    offset: Finite = 0.0
    """Added after ``scale``, in the file's unit."""
    step: Annotated[Finite, Ge(0.0)] = 0.0
    """A command that the machine takes in whole steps only: their size, in the file's unit after
    ``scale`` and ``offset``; what lies between two is cut towards 0. 0: it takes any value."""
    sentinels: tuple[float, ...] = ()
    """Values of the file that mean "no value"."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.column == "?":
            raise UsageError("column: a question that was left open: name the column")
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
    unit: Literal["s", "ms", "us", "ns", "min", "h", "iso", "dmy", "mdy", "clock", "auto"] = "s"
    """Unit of the stamps; of dates as text ``iso``, or ``dmy`` and ``mdy`` where the day or the
    month comes first; ``clock``: times of day; ``auto``: told from each file's stamps."""
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
    """Which files given with ``--data`` belong to this source (file name pattern): a
    bag to every source of its topics, another file to the first that it fits."""
    format: Literal["auto", "csv", "text", "mat", "parquet", "mcap", "bag", "numpy", "carmen"] = (
        "auto"
    )
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
    where: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Only rows whose column has one of these values."""
    offset: Seconds = 0.0
    """Known offset of the source's clock, added to its stamps."""
    left_out: Annotated[float, Ge(0.0), Le(1.0)] = LIMIT
    """Largest share of the rows that may be left out (stamps that go back, repeat or are absurd,
    damaged lines, absurd values); beyond it that is a finding."""
    keep: Duration | None = None
    """How long pushed samples stay in the store, and no shorter than checkpoints need them; absent:
    for good."""
    slack: Annotated[Seconds, Ge(0.0)] = 0.0
    """How far behind this source's newest sample another one's may still come; rows wait for it."""
    timeout: Duration = float("inf")
    """Silent for so long before a tick, it is no longer waited for."""


@dataclass(frozen=True)
class ArraySpec(Section):
    """``[[array]]``: samples that are arrays (scans, images), pushed and stored beside the rows; of
    scans that ``[perception]`` takes recorded too.

    >>> ArraySpec(name="lidar", shape=(360,)).keep is None
    True
    """

    name: str
    """Name of the source that they come from."""
    shape: tuple[Annotated[int, Ge(1), Le(1_000_000)], ...]
    """Shape of one sample."""
    column: str = "values"
    """Where a running machine says its values: a list of so many numbers, row by row."""
    match: str = "*"
    """Which files given with ``--data`` hold it (file name pattern), whatever else they hold."""
    files: tuple[Annotated[str, Late()], ...] = ()
    """Its recordings or patterns, as those of a source."""
    time: TimeSpec = TimeSpec("t")
    """Their stamps, where a running machine says them."""
    keep: Duration | None = None
    """How long they stay in the store; absent: for good."""
