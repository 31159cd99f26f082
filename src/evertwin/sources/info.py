"""What is in a recording, and what is wrong with it, in one pass over the file.

`inspect` gives an `Info`: plain numbers, ready for JSON. Its ``findings`` are the sentences a
person should read before any twin does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.clocks.guard import Guarded, Watch, typical
from evertwin.sources.clocks.stamps import NO_STAMP, StampError, past_midnight, to_ns
from evertwin.sources.clocks.tally import Tally, order_of_rows
from evertwin.sources.clocks.time_unit import TimeGuess, other_clocks, time_column, told
from evertwin.sources.columns.description import (
    ColumnInfo,
    ImageInfo,
    Info,
    ScanInfo,
    TableInfo,
    TimeInfo,
)
from evertwin.sources.columns.no_value import SENTINELS
from evertwin.sources.columns.scans import Scans
from evertwin.sources.columns.stacked import lists, stacked
from evertwin.sources.columns.statistics import ClockStatistics, ColumnStatistics
from evertwin.sources.columns.table import Column, Recording, Rows, Table
from evertwin.sources.info_text import column_findings, table_findings
from evertwin.sources.recording import open_recording
from evertwin.sources.robot_logs.bag_scans import BAGS, scans_of
from evertwin.sources.robot_logs.images import BagImage, Images, images_of
from evertwin.types import Stamps


def inspect(path: Path | str | Recording, shown: Callable[[BagImage], None] | None = None) -> Info:
    """Everything about a recording that one pass can tell; memory stays bounded.

    Args:
        path: of the recording, or one that is open.
        shown: is given each image that can be read.

    Raises:
        DataError: not a recording, or damaged from its first byte on.
        MissingExtra: the library that reads it is not installed.

    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("t [s],v [m/s]\\n0,1\\n0.1,2\\n0.2,nan\\n0.2,3,4\\n0.3,4\\n")
    >>> table = inspect(file).tables[0]
    >>> table.rows, round(table.time.rate), table.columns[1].missing, table.problems
    (4, 10, 1, {'overlong': 1})
    """
    recording = path if isinstance(path, Recording) else open_recording(path)
    path = recording.path
    files = path.rglob("*") if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files if file.is_file())
    tables = tuple(_table(table) for table in recording.tables)
    findings = [*recording.notes]
    for info, table in zip(tables, recording.tables, strict=True):
        findings += [*table_findings(info), *lists(table)]
        findings += column_findings(info, recording.kind in BAGS)
    scans = tuple(_scans(one) for one in scans_of(recording))
    findings += [f"{one.name}: {line}" for one in scans for line in one.findings]
    images = _images(recording, shown)
    findings += [f"{one.name}: {line}" for one in images for line in one.findings]
    return Info(
        path.name, recording.kind, size, tables, recording.notes, tuple(findings), scans, images
    )


def _images(
    recording: Recording, shown: Callable[[BagImage], None] | None
) -> tuple[ImageInfo, ...]:
    topics: dict[str, Images] = {}
    for one in images_of(recording):
        topics.setdefault(one.topic, Images(one.topic)).add(one)
        if shown is not None and isinstance(one, BagImage):
            shown(one)
    return tuple(
        ImageInfo(name, len(of.t), of.rate, tuple(sorted(of.kinds)), len(of.lost), of.findings)
        for name, of in topics.items()
    )


def _scans(scans: Scans) -> ScanInfo:
    n, beams = scans.ranges.shape
    measured = scans.ranges[np.isfinite(scans.ranges)]
    return ScanInfo(
        scans.name, n, beams, scans.rate if scans.timed and n > 1 else None,
        abs(scans.lidar.step) * (beams - 1), scans.lidar.step,
        float(np.min(measured, initial=np.inf)), float(np.max(measured, initial=-np.inf)),
        1 - len(measured) / max(n * beams, 1), scans.odometry is not None,
        (*scans.findings, *filter(None, [scans.assumed])),
    )  # fmt: skip


def _table(table: Table) -> TableInfo:
    time = time_column(table)
    numbers = [c for c in table.columns if c.kind in ("number", "boolean") and c != time]
    stats = [ColumnStatistics() for _ in numbers]
    tally, unit, count = Tally(), None, 0
    watched = _Watched(tally)
    names = [column.name for column in numbers]
    for rows in table.rows(names, None if time is None else time.name, strict=False):
        tally.add(rows.problems)
        count += len(rows.line)
        if len(rows.line) == 0:
            continue
        for j, column in enumerate(stats):
            column.add(rows.line, rows.values[:, j])
        if time is None:
            tally.used += len(rows.line)
        else:
            unit = unit or told(table, time, rows.time)
            watched.add(rows, unit)
    if (lost := watched.finish()) and time is not None:
        tally.suspect(stacked(table, time) or lost)
    words = _words(tally)
    columns = {c.name: _column(c, s, words) for c, s in zip(numbers, stats, strict=True)}
    listed = tuple(columns.get(c.name, ColumnInfo(c.name, c.kind, c.unit, count, 0, 0, also=c.also))
                   for c in table.columns)  # fmt: skip
    described = None if time is None or unit is None else _time(time, unit, watched.clock, tally)
    clocks = () if time is None else other_clocks(table, time)
    return TableInfo(
        table.name, count, described, listed, tally.counts, tally.lines(), clocks,
        tally.left_out, tally.used, tuple(tally.suspicions),
    )  # fmt: skip


@dataclass
class _Watched:
    """The clock of a table: its figures, and what a twin would make of it."""

    tally: Tally
    clock: ClockStatistics = field(default_factory=ClockStatistics)
    watch: Watch | None = None
    last: int = NO_STAMP
    top: Stamps = field(default_factory=lambda: np.zeros(0, np.int64))

    def add(self, rows: Rows, unit: TimeGuess) -> None:
        """Stamps one piece at a time; where a piece holds a word, row by row."""
        try:
            t = to_ns(rows.time, unit.unit)
        except StampError as error:
            if not self.tally.suspicions:
                self.tally.suspect(f"line {rows.line[error.position]}: {error}")
            t = np.array([_stamp(rows.time[i : i + 1], unit.unit) for i in range(len(rows.time))])
        if unit.unit == "clock" and len(t):
            t = past_midnight(t, self.last)
            self.last = int(t.max())
        known = t != NO_STAMP
        self.clock.add(rows.line[known], t[known])
        self.top = self.top if len(self.top) else t[:1000]
        self.watch = self.watch or Watch(typical(t))
        self._count(self.watch.take(rows.line, t, np.zeros((len(t), 0))))

    def finish(self) -> str:
        """The end of the table: what is wrong with the order of its rows, where many are lost."""
        if self.watch is not None:
            self._count(self.watch.finish(0))
        return order_of_rows(self.top) if self.tally.share > self.tally.limit else ""

    def _count(self, out: Guarded) -> None:
        self.tally.add(out.problems)
        self.tally.used += len(out.t)


def _stamp(cell: np.ndarray, unit: str) -> int:
    try:
        return int(to_ns(cell, unit)[0])
    except DataError:
        return NO_STAMP


def _words(tally: Tally) -> dict[str, int]:
    """Words per column, from the tally's kept examples (at most 20 are kept whole)."""
    out: dict[str, int] = {}
    for problem in tally.first.get("text", []):
        name = problem.detail.rpartition(": ")[0]
        out[name] = out.get(name, 0) + 1
    return out


def _column(column: Column, s: ColumnStatistics, words: dict[str, int]) -> ColumnInfo:
    absurd = tuple(s.absurd())
    extremes = {value for value, _ in absurd} | {v for v, _ in s.lows[:1] + s.highs[:1]}
    return ColumnInfo(
        column.name, column.kind, column.unit, s.count, s.missing, s.infinite,
        words.get(column.name, 0),
        s.lows[0][0] if s.lows else float("nan"),
        s.highs[0][0] if s.highs else float("nan"),
        s.mean, s.std, s.longest, s.longest_line, s.changes, absurd,
        tuple(sorted(extremes & SENTINELS - {s.none})),
        None if s.none is None else (s.none, s.nones), column.also,
    )  # fmt: skip


def _time(column: Column, unit: TimeGuess, clock: ClockStatistics, tally: Tally) -> TimeInfo | None:
    if clock.rows == 0:
        return None
    steps = clock.sample.values
    low, middle, high = np.quantile(steps, [0.05, 0.5, 0.95]) if len(steps) else (0.0, 0.0, 0.0)
    gaps = [(s, at) for s, at in clock.longest if s > 5 * middle]
    longest = gaps[0] if gaps else (0.0, 0)
    return TimeInfo(
        column.name, unit.unit, unit.reason, unit.sure, clock.low, clock.high,
        (clock.high - clock.low) * 1e-9, float(middle), float(low), float(high),
        float(high - low) / 2, len(gaps), longest[0], longest[1],
        clock.repeated, clock.backward, tally.counts.get("no_stamp", 0),
    )  # fmt: skip
