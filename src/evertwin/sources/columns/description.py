"""A recording, described: plain numbers, ready for JSON.

>>> Info("run.csv", "csv", 10, ()).to_dict()["schema"]
'evertwin.info/1'
"""

from __future__ import annotations

from dataclasses import dataclass

from evertwin.fold import plain
from evertwin.types import Json


@dataclass(frozen=True)
class TimeInfo:
    """The clock of one table; everything in seconds but the stamps.

    >>> TimeInfo("t", "s", "stated", True, 0, 10**9, 1.0, 0.01, 0.01, 0.01, 0.0).rate
    100.0
    """

    column: str
    unit: str
    reason: str
    """Why this unit."""
    sure: bool
    start: int
    """Smallest stamp [ns]."""
    end: int
    """Largest stamp [ns]."""
    duration: float
    period: float
    """Median step forward."""
    period_low: float
    """5 % quantile of the step."""
    period_high: float
    """95 % quantile of the step."""
    jitter: float
    """Half the distance between those two."""
    gaps: int = 0
    """Steps of more than five periods (the 20 longest are looked at)."""
    longest_gap: float = 0.0
    longest_gap_line: int = 0
    repeated: int = 0
    backward: int = 0
    no_stamp: int = 0

    @property
    def rate(self) -> float:
        """Rows per second, from the median step; NaN for a single row."""
        return 1 / self.period if self.period > 0 else float("nan")


@dataclass(frozen=True)
class ColumnInfo:
    """One column.

    >>> ColumnInfo("v", "number", "m/s", 0, 0, 0).unit
    'm/s'
    """

    name: str
    kind: str
    unit: str
    count: int
    missing: int
    infinite: int
    text: int = 0
    """Cells that are words in a column of numbers."""
    low: float = float("nan")
    high: float = float("nan")
    mean: float = float("nan")
    std: float = float("nan")
    constant_rows: int = 0
    """Longest stretch of equal values."""
    constant_line: int = 0
    changes: int = 0
    absurd: tuple[tuple[float, int], ...] = ()
    """(value, line) far outside the rest; at most ten to either side."""
    sentinels: tuple[float, ...] = ()
    """Extremes that are common words for "no measurement"."""
    recurring: tuple[float, int] | None = None
    """A value that recurs far off those beside it each time, and in how many cells."""
    also: tuple[str, ...] = ()
    """Further names that the file gives it."""

    @property
    def counts(self) -> bool:
        """Does it go up by one from row to row, and so tells no more than the row?

        >>> ColumnInfo("k", "number", "", 9, 0, 0, low=1.0, high=9.0, changes=9).counts
        True
        """
        counted = self.high - self.low == self.count - 1 and float(self.low).is_integer()
        return self.kind == "number" and self.changes == self.count > 2 and counted


@dataclass(frozen=True)
class ClockInfo:
    """A second clock of a table against the first; seconds.

    >>> ClockInfo("logged", 0.2, 1e-5, 1e-7, 0.004, 1000).offset
    0.2
    """

    column: str
    offset: float
    """Second clock minus first, in the middle of the rows."""
    drift: float
    """Growth of the offset, seconds per second."""
    drift_sigma: float
    """Its standard error, for rows whose scatter is independent."""
    jitter: float
    """Standard deviation about that line: what the transport adds."""
    rows: int
    """Rows that tell both."""


@dataclass(frozen=True)
class TableInfo:
    """One table of the recording.

    >>> TableInfo("", 0, None, ()).problems
    {}
    """

    name: str
    rows: int
    time: TimeInfo | None
    columns: tuple[ColumnInfo, ...]
    problems: dict[str, int] | None = None
    """Rows left out, by kind."""
    examples: tuple[str, ...] = ()
    """The first of each kind, with its line."""
    clocks: tuple[ClockInfo, ...] = ()
    """Further columns of time against the first."""
    left_out: int = 0
    """Rows that a twin would not use."""
    used: int = 0
    """Rows that it would."""
    suspicions: tuple[str, ...] = ()
    """What is probably wrong with the clock."""

    @property
    def loss(self) -> str:
        """The rows left out, as a line; empty where there are none."""
        rows = self.used + self.left_out
        share = f"{100 * self.left_out / max(rows, 1):.3g} %"
        return f"{self.left_out} of {rows} rows are left out ({share})" if self.left_out else ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "problems", dict(self.problems or {}))


@dataclass(frozen=True)
class ScanInfo:
    """The scans of one lidar.

    >>> ScanInfo("FLASER", 440, 180, 0.5, 3.12, 0.0175, 0.6, 29.4, 0.02).beams
    180
    """

    name: str
    count: int
    beams: int
    rate: float | None
    """Scans per second, from the median step; None where no stamp tells it."""
    field_of_view: float
    """From the first beam to the last [rad]."""
    step: float
    """From beam to beam [rad]."""
    nearest: float
    """Shortest range measured [m]."""
    farthest: float
    """Longest range measured [m]."""
    empty: float
    """Share of the beams that nothing came back from."""
    odometry: bool = False
    """Whether odometry that can be relied on stands beside them."""
    findings: tuple[str, ...] = ()


@dataclass(frozen=True)
class ImageInfo:
    """The images of one topic.

    >>> ImageInfo("/camera", 40, 10.0, (), 1).lost
    1
    """

    name: str
    count: int
    rate: float | None
    """Images per second, from the median step; None where no stamp tells it."""
    kinds: tuple[tuple[int, int, str], ...]
    """Width, height, encoding."""
    lost: int
    """Of the count, those that cannot be read."""
    findings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Info:
    """A recording, described.

    >>> Info("run.csv", "csv", 10, ()).to_dict()["kind"]
    'csv'
    """

    file: str
    kind: str
    bytes: int
    tables: tuple[TableInfo, ...]
    notes: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    scans: tuple[ScanInfo, ...] = ()
    images: tuple[ImageInfo, ...] = ()

    def to_dict(self) -> dict[str, Json]:
        """Plain values for JSON; NaN is None, the rate stands beside the period."""
        out = plain(self)
        assert isinstance(out, dict)
        for table, source in zip(out["tables"], self.tables, strict=True):
            if source.time is not None:
                table["time"]["rate"] = plain(source.time.rate)
        return {"schema": "evertwin.info/1", **out}
