"""A recorded source: files in, chunks in SI units on a clean clock out.

Each file is a task; a column may open further tasks where its value changes. The clock goes through
`guard`, values through ``si = to_si(cell · scale + offset, unit)``; a sentinel becomes infinite,
which later stages mark as an error; an empty cell is NaN, which they mark as absent. Nothing is
dropped without being counted in ``tally``.

>>> import tempfile
>>> file = Path(tempfile.mkdtemp()) / "run.csv"
>>> _ = file.write_text("time_ms,v\\n0,5\\n20,-99\\n40,7\\n")
>>> source = Recorded("odometry", (file,), (Cell("v", "v", "cm/s", sentinels=(-99.0,)),))
>>> [(chunk.t.tolist(), chunk.v[:, 0].tolist()) for chunk in source.read()]
[([0, 20000000, 40000000], [0.05, inf, 0.07])]
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.fold import Chunk
from evertwin.fold.block import LARGEST
from evertwin.sources.clocks.dates import ORDERS
from evertwin.sources.clocks.guard import Guarded, Piece, Watch, typical
from evertwin.sources.clocks.stamps import (
    NO_STAMP,
    StampError,
    is_decimal,
    past_midnight,
    to_ns,
    zones,
)
from evertwin.sources.clocks.tally import Tally, order_of_rows, unit_of_channel, unit_of_time
from evertwin.sources.clocks.time_unit import TimeGuess, guess, time_column, told
from evertwin.sources.columns.cells import Cell, InSi
from evertwin.sources.columns.names import closest
from evertwin.sources.columns.table import Column, Problem, Recording, Rows, Table
from evertwin.sources.recording import open_recording
from evertwin.sources.spec import SourceSpec
from evertwin.sources.texts.dialect import FOUND, Stated
from evertwin.sources.texts.empty_cells import EmptyCells
from evertwin.types import Bool, Outputs, Stamps

Files: TypeAlias = tuple[Path | Recording, ...]
"""Files, or recordings that are open already."""
FORMATS = {
    "csv": ("csv",), "text": ("csv",), "mat": ("mat",), "parquet": ("parquet",),
    "mcap": ("mcap",), "bag": ("ros1", "ros2"), "numpy": ("npy", "npz"), "carmen": ("carmen",),
}  # fmt: skip
"""Name in a twin file to the kinds of file that it means."""


@dataclass(frozen=True)
class Clock:
    """Where the stamps come from: a column, or a fixed rate for a table without one.

    >>> Clock(rate=20.0).unit
    'auto'
    """

    column: str | int | None = None
    """Name or position of the column of time; None: found by name, kind or position."""
    unit: str = "auto"
    """s, ms, us, ns, min, h, one of `ORDERS`, or auto; ``iso`` is told from the file, too."""
    rate: float | None = None
    """Rows per second [Hz] where there is no column of time."""
    offset: int = 0
    """Added to every stamp [ns]: the source's known clock offset."""

    def __post_init__(self) -> None:
        if self.rate is not None and not 0 < self.rate < 1e9:
            raise UsageError(f"rate: expected a number above 0 Hz, got {self.rate}")


@dataclass(frozen=True)
class Recorded:
    """Files of one source, read in the order given. Implements `Source`.

    >>> Recorded("pose", (), ()).name
    'pose'
    """

    name: str
    files: Files
    cells: tuple[Cell, ...]
    clock: Clock = field(default_factory=Clock)
    task: str | int | None = None
    """Column whose change opens a new task."""
    tally: Tally = field(default_factory=Tally, compare=False)
    """Problems found while reading."""
    stated: Stated = FOUND
    """What the user says of how its text tables are written."""
    format: str = "auto"
    """One of `FORMATS`: files of another kind are refused; auto: any."""
    where: tuple[tuple[float, ...], ...] = ()
    """Values of the last cells, one for each: only rows that have one of them are read."""
    sparse: bool = False
    """Are cells without a number usual, as of beams that did not come back?"""

    @classmethod
    def of(cls, spec: SourceSpec, files: Files, tally: Tally | None = None) -> Recorded:
        """The source of a twin file over these files."""
        cells = [
            Cell(name, c.column, c.unit, c.scale, c.offset, c.sentinels, c.step)
            for name, c in spec.channels.items()
        ]
        cells += [Cell(f"?{column}", column, "1") for column in spec.where]
        time = spec.time
        clock = Clock(time.column, time.unit, time.rate, round(spec.offset * 1e9))
        stated = Stated(spec.header, spec.delimiter, spec.decimal)
        tally = Tally(spec.name, spec.left_out) if tally is None else tally
        return cls(
            spec.name, files, tuple(cells), clock, spec.task, tally, stated, spec.format,
            tuple(spec.where.values()),
        )  # fmt: skip

    @cached_property
    def in_si(self) -> InSi:
        """What makes SI values of its cells."""
        return InSi.of(self.cells)

    def open(self) -> None:
        """Check that every file holds the columns.

        Raises:
            DataError: a file cannot be read or lacks a column.
        """
        for file in self.files:
            self._wiring(file)

    async def chunks(self) -> AsyncIterator[Chunk]:
        """See `Source`."""
        for chunk in self.read():
            yield chunk

    def close(self) -> None:
        """Nothing is held open between pieces."""

    def read(self) -> Iterator[Chunk]:
        """The chunks, as a plain iterator.

        Raises:
            DataError: with file, line and column.
        """
        task = -1
        for file in self.files:
            top, name = _Top(), _name(file)
            width = len(self.cells) - len(self.where)
            cells = EmptyCells([cell.channel for cell in self.cells[:width]])
            for opens, out in self._guarded(file, top):
                task += int(opens)
                chunk = self._wanted(Chunk(self.name, out.t, self._si(out, name), task))
                if len(chunk.t):
                    cells.add(chunk.t, chunk.v, out.line[np.searchsorted(out.t, chunk.t)])
                    yield chunk
            for channel, count, line in () if self.sparse else cells.found():
                self.tally.empty(
                    channel, count, Problem("empty", line, f"{channel}: no value", name)
                )
            self._suspect(top)

    def samples(self) -> Chunk:
        """All rows as one chunk, as they came: stamps are judged where they are aligned.

        Raises:
            DataError: a row has no stamp.
        """
        parts = []
        for file in self.files:
            for line, t, v in self._pieces(file, _Top()):
                if len(none := np.flatnonzero(t == NO_STAMP)):
                    raise DataError(f"{_name(file)}: row {line[none[0]]} has no stamp")
                si = self._si(Guarded(line, t, v[:, : len(self.cells)], ()), _name(file))
                parts.append(self._wanted(Chunk(self.name, t, si)))
        if not parts:
            raise DataError(f"{self.name}: no row")
        t, v = (np.concatenate(of) for of in zip(*(c[1:3] for c in parts), strict=True))
        return Chunk(self.name, t, v)

    def _wanted(self, chunk: Chunk) -> Chunk:
        """The rows whose last cells have one of the values of ``where``, without those cells."""
        width = len(self.cells) - len(self.where)
        keep = np.ones(len(chunk.t), dtype=np.bool_)
        for k, wanted in enumerate(self.where):
            keep &= np.isin(chunk.v[:, width + k], np.array(wanted, dtype=np.float64))
        v = chunk.v if width == len(self.cells) else chunk.v[:, :width]
        return chunk._replace(v=v) if keep.all() else chunk._replace(t=chunk.t[keep], v=v[keep])

    def _suspect(self, top: _Top) -> None:
        """What is probably wrong, where it is evident or rows fell away."""
        lost = self.tally.share > self.tally.limit
        looks = top.sized if lost and top.beyond else top.looks
        said = "" if looks is None else unit_of_time(looks, top.unit, lost=lost)
        if said and self.tally.doubt in self.tally.suspicions:  # what was asked is known now
            self.tally.suspicions.remove(self.tally.doubt)
        self.tally.suspect(said)
        if lost:
            self.tally.suspect(order_of_rows(top.t))

    def _guarded(self, file: Path | Recording, top: _Top) -> Iterator[tuple[bool, Guarded]]:
        """Clean rows, each task with a watch of its own; True where a task opens."""
        watch: Watch | None = None
        step, code = 0, float("nan")
        for line, t, v in self._pieces(file, top):
            step = step or typical(t)
            for value, rows in self._parts(v):
                if watch is None or value != code:
                    if watch is not None:
                        yield False, watch.finish(len(self.cells))
                    watch, code = Watch(step), value
                    yield True, watch.take(line[rows], t[rows], v[rows, : len(self.cells)])
                else:
                    yield False, watch.take(line[rows], t[rows], v[rows, : len(self.cells)])
        if watch is not None:
            yield False, watch.finish(len(self.cells))

    def _parts(self, v: Outputs) -> Iterator[tuple[float, slice]]:
        """The rows of each task; without a task column all of them."""
        if self.task is None:
            yield 0.0, slice(None)
            return
        code = np.nan_to_num(v[:, -1], nan=-np.inf)
        cuts = [0, *(np.flatnonzero(np.diff(code) != 0) + 1).tolist(), len(code)]
        for a, b in pairwise(cuts):
            yield float(code[a]), slice(a, b)

    def _wiring(self, file: Path | Recording) -> _Wiring:
        recording = file if isinstance(file, Recording) else open_recording(file, self.stated)
        kinds = ("memory", *FORMATS.get(self.format, (recording.kind,)))
        if recording.kind not in kinds:
            raise DataError(
                f"{_name(file)}: source {self.name!r} expects {self.format}, this is "
                f"{recording.kind}: name another file, or write format = 'auto'"
            )
        if len(recording.tables) == 1:
            table = recording.tables[0]
        else:
            found = {recording.find(str(cell.column))[0].name for cell in self.cells}
            if len(found) != 1:
                raise DataError(
                    f"{_name(file)}: source {self.name!r} takes columns of {len(found)} topics "
                    f"({', '.join(sorted(found))}): give each topic a source of its own"
                )
            topic = found.pop()
            table = next(t for t in recording.tables if t.name == topic)
        columns = [_column(table, cell.column) for cell in self.cells]
        for cell, column in zip(self.cells, columns, strict=True):
            if (cell.scale, cell.offset) == (1.0, 0.0):
                self.tally.suspect(unit_of_channel(cell.channel, column.unit, cell.unit))
        columns += [] if self.task is None else [_column(table, self.task)]
        names = tuple(column.name for column in columns)
        return _Wiring(table, names, _time_column(table, self.clock))

    def _pieces(self, file: Path | Recording, top: _Top) -> Iterator[Piece]:
        table, numbers, time = self._wiring(file)
        for rows in table.rows(numbers, None if time is None else time.name):
            self.tally.add(rows.problems, _name(file))
            if len(rows.line) == 0:
                continue
            if time is not None and not top.unit:
                top.looks = guess(time.name, rows.time[:1000], time.unit)
                top.sized = guess("", rows.time[:1000])
                top.unit = _unit(table, time, rows, self.clock.unit)
                step, stated = top.looks.step, top.looks.stated
                self.tally.advance = step, top.unit, stated or not step.is_integer()
                dates = top.unit in ORDERS and rows.time.dtype.kind == "S"
                self.tally.local |= dates and zones(rows.time) == {False}
            t = self._stamps(table, time, rows, top)
            top.t = top.t if len(top.t) else t[:1000]
            yield rows.line, t, rows.values

    def _stamps(self, table: Table, time: Column | None, rows: Rows, top: _Top) -> Stamps:
        if time is None:
            assert self.clock.rate is not None
            step = 1e9 / self.clock.rate
            exact = rows.order * int(step) if step == int(step) else np.rint(rows.order * step)
            return exact.astype(np.int64) + self.clock.offset
        try:
            t = to_ns(rows.time, top.unit)
        except StampError as error:
            where = f"{table.path.name}:{rows.line[error.position]}: column {time.name!r}"
            raise DataError(f"{where}: {error}") from None
        if is_decimal(top.unit) and (none := t == NO_STAMP).any():
            top.beyond |= bool((to_ns(rows.time[none], "ns") != NO_STAMP).any())
        if top.unit == "clock":
            t = past_midnight(t, top.last)
            top.last = int(t.max())
        known = t != NO_STAMP
        return np.where(known, t + self.clock.offset, t)

    def _si(self, out: Guarded, file: str) -> Outputs:
        si, none = self.in_si(out.v)
        self._count(out, (np.abs(si) > LARGEST) & ~none, file)
        return si

    def _count(self, out: Guarded, absurd: Bool[np.ndarray, "n k"], file: str) -> None:
        """What was left out of these rows, and what of them is used."""
        absurd = absurd & ~np.isinf(out.v) if self.sparse else absurd
        rows = np.flatnonzero(absurd.any(axis=1)).tolist()
        for i in rows:
            j = int(np.argmax(absurd[i]))
            detail = f"{self.cells[j].channel}: {out.v[i, j]:.6g}"
            self.tally.add((Problem("absurd", int(out.line[i]), detail),), file)
        self.tally.add(out.problems, file)
        self.tally.used += len(out.t) - len(rows)


@dataclass
class _Top:
    """What the first rows of a file say of its clock."""

    unit: str = ""
    """What the stamps are read in."""
    looks: TimeGuess | None = None
    """What they look like."""
    sized: TimeGuess | None = None
    """What they look like by their numbers alone, whatever the file says."""
    beyond: bool = False
    """Are there stamps that only a finer unit could hold?"""
    t: Stamps = field(default_factory=lambda: np.zeros(0, np.int64))
    last: int = NO_STAMP
    """The stamp that the piece before ended with."""


def _name(file: Path | Recording) -> str:
    return (file if isinstance(file, Path) else file.path).name


class _Wiring(NamedTuple):
    table: Table
    numbers: tuple[str, ...]
    time: Column | None


def _column(table: Table, key: str | int) -> Column:
    """A column by name or by position from 0."""
    columns = table.columns
    if isinstance(key, int):
        if not 0 <= key < len(columns):
            raise DataError(
                f"{table.path.name}: no column {key}: there are {len(columns)}, counted from 0"
            )
        return columns[key]
    named = [c for c in columns if c.name == key] or [c for c in columns if c.called(key)]
    if not named:
        names = [c.name for c in columns]
        raise DataError(
            f"{table.path.name}: no column {key!r}; {closest(key, names)}: correct the name in the "
            "twin file"
        )
    return named[0]


def _time_column(table: Table, clock: Clock) -> Column | None:
    if clock.column is not None:
        return _column(table, clock.column)
    if clock.rate is not None:
        return None
    found = time_column(table)
    if found is None:
        raise DataError(
            f"{table.path.name}: no column of time among "
            f"{', '.join(c.name for c in table.columns[:12])}: set time = {{ column = … }}, or "
            "{ rate = … } for rows at a fixed rate"
        )
    return found


def _unit(table: Table, time: Column, rows: Rows, unit: str) -> str:
    found = TimeGuess(unit, "stated", True)
    if unit in ("auto", "iso"):
        looks = told(table, time, rows.time)
        found = looks if unit == "auto" or looks.unit in ORDERS else found
    if not found.sure:
        other = ' or "mdy"' if found.unit == "dmy" else ""
        raise DataError(
            f"{table.path.name}: column {time.name!r}: the unit of time is not clear "
            f'({found.reason}; {found.unit}?): set time = {{ unit = "{found.unit}"{other} }}'
        )
    if found.unit in ORDERS and rows.time.dtype.kind == "S" and len(zones(rows.time)) > 1:
        raise DataError(
            f"{table.path.name}: column {time.name!r}: some stamps carry a time zone and some do "
            "not: write all of them in one way, best in UTC"
        )
    return found.unit
