"""What a proposal is made from: the tables of some recordings, described, with their first rows.

Recordings with the same tables are one source's tasks; a table that another recording has not is a
source of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from evertwin.errors import DataError
from evertwin.publishers.ros_spec import RosOutSettings
from evertwin.sources.clocks.exported import parts_of
from evertwin.sources.clocks.stamps import NO_STAMP, to_ns
from evertwin.sources.columns.description import ColumnInfo, Info, TableInfo
from evertwin.sources.columns.names import sampled
from evertwin.sources.columns.table import Recording
from evertwin.sources.info import inspect
from evertwin.sources.recording import open_recording
from evertwin.starter.looks.apart import themes
from evertwin.starter.looks.words import quantity, said_unit, words
from evertwin.types import Float64, Vector

ROWS = 50_000
"""Rows that relations between columns are told from."""
LOST = 0.5
"""Share of a table's rows from which on it is not looked at what the others tell."""
HELD, UNEVEN = 0.5, 2.0
"""Share of the rows that repeat the one before, and longest step over shortest without the rarest
twentieths, from which on a table is not sampled: it says what holds until it says more."""
MOSTLY, BEYOND = 0.9, 100.0
"""Share of a column's rows, and so many times as far as these reach is another unit, or none."""
COUNTED = {
    "sample", "samples", "index", "idx", "row", "record", "nr", "no", "number", "seq", "count",
    "counter", "line", "zeile", "point", "unnamed",
}  # fmt: skip
"""Words of a column that counts rows."""
FIXED = ("odom", "map", "world", "earth")
"""Frames that are no part of a machine (REP-105)."""


@dataclass(frozen=True)
class Seen:
    """A table, and the recordings that have it.

    >>> info = TableInfo("", 3, None, (ColumnInfo("v", "number", "m/s", 3, 0, 0, low=0, high=1),))
    >>> seen = Seen((Path("run.csv"),), info, None, np.zeros((3, 1)))
    >>> [column.name for column in seen.columns]
    ['v']
    """

    files: tuple[Path, ...]
    table: TableInfo
    t: Vector | None
    """Stamps of its first rows [s]; None: it has no column of time."""
    rows: Float64[np.ndarray, "n columns"]
    """Their numbers, (n, columns)."""
    theme: str = ""
    """What its name says of its columns, which those of the others do not say of theirs."""
    every: float | None = None
    """Seconds from row to row, where a person says it of rows without stamps."""
    source: str = ""
    """Name of its source, where a site file has one."""

    @property
    def columns(self) -> tuple[ColumnInfo, ...]:
        """Columns of numbers beside the clocks, and beside the parts of what is a column."""
        return _numbers(self.table)

    def values(self, column: str) -> Vector:
        """The first rows of a column."""
        return self.rows[:, [c.name for c in self.columns].index(column)]

    def holds(self, columns: Sequence[str]) -> bool:
        """Do these columns hold their values from row to row? Most rows repeat the one before, or
        they come as often as something changes."""
        time = self.table.time
        if time is None or not columns or len(self.rows) < 2:
            return False
        values = np.column_stack([self.values(name) for name in columns])
        same = (values[1:] == values[:-1]).all(axis=1)
        return bool(same.mean() > HELD or time.period_high > UNEVEN * time.period_low)

    @property
    def period(self) -> float | None:
        """Seconds from row to row: of the column of time, or what a person or a constant column
        says."""
        if self.table.time is not None or self.every is not None:
            return self.every if self.table.time is None else self.table.time.period
        said = (sampled(c.name, c.low) for c in self.columns if c.low == c.high)
        return next((value for value in said if value is not None), None)

    @property
    def clock(self) -> Vector | None:
        """When its first rows were [s]: by their stamps, or their period; None: nobody says."""
        if self.t is not None or self.period is None:
            return self.t
        return self.period * np.arange(len(self.rows))

    @cached_property
    def shared(self) -> frozenset[str]:
        """Numbers that every heading has: they tell no column from another."""
        said = [set(words(column.name)) for column in self.columns]
        several = set.intersection(*said) if len(said) > 1 else set[str]()
        return frozenset(word for word in several if word.isdigit())

    @cached_property
    def task(self) -> str:
        """The column that tells one experiment from the next: it changes exactly where time, or
        another column that else always grows, falls; empty: none."""
        clocks = [*self.rows.T] if self.t is None else [self.t]
        for clock in clocks:
            falls = np.diff(clock) < 0.0
            if falls.any() and np.all(np.diff(clock)[~falls] > 0.0):
                for k, column in enumerate(self.columns):
                    if np.array_equal(np.diff(self.rows[:, k]) != 0.0, falls):
                        return column.name
        return ""

    @property
    def about(self) -> str:
        """What names it says beyond its headings: the topic, or the name of its file."""
        return self.table.name or self.files[0].name.split(".")[0]


def _numbers(table: TableInfo) -> tuple[ColumnInfo, ...]:
    clocks = {clock.column for clock in table.clocks}
    clocks |= set() if table.time is None else {table.time.column}
    clocks |= parts_of(column.name for column in table.columns)
    return tuple(
        c if c.unit else replace(c, unit=said_unit(c.name))
        for c in table.columns if c.kind in ("number", "boolean") and c.name not in clocks
    )  # fmt: skip


def look(files: Sequence[Path]) -> tuple[tuple[Seen, ...], tuple[Info, ...]]:
    """The different tables of recordings, and each recording described.

    Raises:
        DataError: a file cannot be read, or loses most of its rows, or none has two.
    """
    told = list[Info]()
    found: dict[tuple[str, ...], Seen] = {}
    for file in files:
        recording = open_recording(_there(file))
        info = inspect(recording)
        told.append(info)
        for table in map(_machines, info.tables):
            said = quantity(words(file.name.split(".")[0]))  # positions and torques may share names
            key = (table.name, said, *(column.name for column in table.columns))
            if table.left_out > LOST * (table.used + table.left_out):
                why = "; ".join((*table.suspicions, *table.examples)[:1])
                raise DataError(f"{file}: {table.loss}: {why}")
            if table.rows < 2 or not _numbers(table):
                continue
            if key in found:
                before = found[key]
                both = _widened(before.table, table)
                found[key] = Seen((*before.files, file), both, before.t, before.rows)
            else:
                t, rows = _beginning(recording, table)
                found[key] = Seen((file,), _mostly(table, rows), t, rows)
    if not found:
        names = ", ".join(str(file) for file in files)
        raise DataError(f"{names}: fewer than two complete rows: look with evertwin info")
    return _with_themes(tuple(found.values())), tuple(told)


def _with_themes(seen: Sequence[Seen]) -> tuple[Seen, ...]:
    """What the names of topics, and of files, say of their columns."""
    topics = [one for one in seen if one.table.name]
    said = themes([one.table.name for one in topics], files=False)
    files = [one for one in seen if not one.table.name]
    said += themes([one.about for one in files])
    named = dict(zip(map(id, [*topics, *files]), said, strict=True))
    return tuple(replace(one, theme=named[id(one)]) for one in seen)


def _machines(table: TableInfo) -> TableInfo:
    """Without what is not the machine's own: what a twin says of it, where frames of reference are
    (``map → odom``), and what counts the rows."""
    fixed = [f".transforms.{frame}.transform." for frame in FIXED]
    own = table.name.startswith(f"{RosOutSettings.topic}/")
    kept = (
        c for c in table.columns
        if not own and not any(part in c.name for part in fixed) and not _counts(c, table)
    )  # fmt: skip
    return replace(table, columns=tuple(kept))


def _counts(column: ColumnInfo, table: TableInfo) -> bool:
    """Does a column go up by one from row to row, and say that it counts, or come first?"""
    if column.unit or (table.time is not None and column.name == table.time.column):
        return False
    named = not COUNTED.isdisjoint(words(column.name))
    return (named or column is table.columns[0]) and column.counts


def _widened(one: TableInfo, other: TableInfo) -> TableInfo:
    """A table whose columns reach as far as those of two recordings."""
    pairs = zip(one.columns, other.columns, strict=True)
    columns = (
        replace(a, low=float(np.fmin(a.low, b.low)), high=float(np.fmax(a.high, b.high)))
        for a, b in pairs
    )
    return replace(one, columns=tuple(columns))


def _mostly(table: TableInfo, rows: Float64[np.ndarray, "n columns"]) -> TableInfo:
    """A table whose columns reach as far as nearly all of their rows do: a sentinel, or a burst in
    another unit, says nothing of what they are in."""
    found = {c.name: _reach(c, v) for c, v in zip(_numbers(table), rows.T, strict=True)}
    columns = (
        replace(c, low=found[c.name][0], high=found[c.name][1]) if c.name in found else c
        for c in table.columns
    )
    return replace(table, columns=tuple(columns))


def _reach(column: ColumnInfo, values: Vector) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    most = BEYOND * float(np.quantile(np.abs(known), MOSTLY)) if len(known) else 0.0
    if not 0.0 < most < max(abs(column.low), abs(column.high)):
        return column.low, column.high
    known = known[np.abs(known) <= most]
    return float(known.min()), float(known.max())


def _there(file: Path) -> Path:
    if not file.exists():
        raise DataError(f"{file}: no such file")
    return file


def _beginning(recording: Recording, table: TableInfo) -> tuple[Vector | None, np.ndarray]:
    """The first rows of a table: stamps [s] and numbers."""
    source = next(t for t in recording.tables if t.name == table.name)
    names, time = [column.name for column in _numbers(table)], table.time
    stamps, rows, count = [], [], 0
    for piece in source.rows(names, None if time is None else time.column, strict=False):
        rows.append(piece.values)
        if time is not None:
            stamps.append(_seconds(piece.time, time.unit))
        count += len(piece.values)
        if count >= ROWS:
            break
    values = np.concatenate(rows)[:ROWS]
    return (np.concatenate(stamps)[:ROWS] if stamps else None), values


def _seconds(raw: np.ndarray, unit: str) -> Vector:
    """Seconds; NaN where a cell is no stamp."""
    try:
        t = to_ns(raw, unit)
    except DataError:
        if len(raw) == 1:
            return np.full(1, np.nan)
        return np.concatenate([_seconds(raw[i : i + 1], unit) for i in range(len(raw))])
    return np.where(t == NO_STAMP, np.nan, t * 1e-9)
