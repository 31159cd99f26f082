"""Older days of samples as Parquet files, one a day and source, whose hashes the log keeps.

    samples of the store ─ a day is over, and old ─▶ FILE.days/SOURCE/2026-11-20.812.parquet
                                                         │ SHA-256
                          log: event "archived" ◀────────┘   then they leave the store

The file is whole on the disk before the log names it, and the same transaction that names it takes
the samples out of the store: each sample is in one of the two, whenever the process is killed. A
file holds ``number`` (of the piece as it arrived), ``task``, ``t_ns`` and a column for each value,
in SI, so DuckDB and pandas read it as it is; so does `SqliteStore.samples`, through DuckDB. What is
absent is null, and what was refused (a sentinel, a value that its machine calls bad), where
``refused`` names the columns.

>>> day_of(1_700_000_000 * 10**9), edges("2023-11-14")
('2023-11-14', (1699920000000000000, 1700006400000000000))
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakMethod

import numpy as np

from evertwin.errors import StoreDamaged
from evertwin.fold import Chunk, Event
from evertwin.sources.foreign import load

KIND = "archived"
"""Of the event that names a file."""
OWN = ("number", "task", "t_ns")
"""Columns before the values."""
REFUSED = "refused"
"""Column behind them: whose value was refused, after a minus where it was negative."""
DAY = 86_400 * 10**9
PIECE = 100_000
"""Samples that are read or written at once."""
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class Day(NamedTuple):
    """A file, as the log names it.

    >>> Day("odometry/2026-11-20.812.parquet", "00", "odometry", 86400, 812, (), 0, 10).samples
    86400
    """

    file: str
    """Below the folder."""
    sha256: str
    source: str
    samples: int
    last: int
    """Number of the newest piece that was stored when it was written."""
    shape: tuple[int, ...]
    """Of one sample, where the source gives arrays."""
    start: int
    """Stamps [ns] of the oldest and the newest sample."""
    stop: int

    def event(self, row: int) -> Event:
        """What the log says of it, before a row."""
        evidence = self._asdict()
        said = f"{self.samples} samples of {self.day} went to {self.file}"
        return Event(row, 0, KIND, evidence.pop("source"), said, evidence)

    @classmethod
    def of(cls, event: Event) -> Day:
        """From what the log says."""
        told: Any = event.evidence
        return cls(
            str(told["file"]), str(told["sha256"]), event.signal, int(told["samples"]),
            int(told["last"]), tuple(told["shape"]), int(told["start"]), int(told["stop"]),
        )  # fmt: skip

    @property
    def day(self) -> str:
        """As in 2026-11-20."""
        return Path(self.file).name.partition(".")[0]

    @property
    def gone(self) -> tuple[str, int, int, int]:
        """Source, span [ns] and last number of the pieces that leave the store for it."""
        return (self.source, *edges(self.day), self.last)


def day_of(stamp: int) -> str:
    """The day of a stamp [ns], UTC."""
    return (EPOCH + timedelta(days=stamp // DAY)).strftime("%Y-%m-%d")


def edges(day: str) -> tuple[int, int]:
    """Its beginning and end [ns]."""
    begin = (datetime.strptime(day, "%Y-%m-%d").replace(tzinfo=UTC) - EPOCH).days * DAY
    return begin, begin + DAY


class Archive:
    """The files of one store. See the module.

    >>> from evertwin.store import SqliteStore
    >>> SqliteStore(":memory:").archive.days
    ()
    """

    def __init__(self, store: str, events: Callable[[int], Sequence[tuple[int, Event]]]) -> None:
        """
        Args:
            store: path of the store.
            events: the events of this kind behind a position of its log, with their positions.
        """
        self.folder = Path(f"{store}.days")
        self._events = WeakMethod(events)  # so that who forgets to close a store leaves no lock
        self._known: list[Day] = []
        self._read = 0
        self._whole: set[str] = set()
        """Files whose hash was looked at by this process."""

    @property
    def days(self) -> Sequence[Day]:
        """As the log names them, in its order."""
        events = self._events()
        for number, event in () if events is None else events(self._read):
            self._known.append(Day.of(event))
            self._read = number
        return tuple(self._known)

    def write(
        self, source: str, day: str, pieces: Iterator[tuple[int, Chunk]], names: Sequence[str]
    ) -> Day | None:
        """A file with the pieces of a day; None: there are none. It counts once the log names it.

        Args:
            source: of the samples.
            day: as in 2026-11-20.
            pieces: by number, as the store gives them.
            names: of the columns; empty: of a source of arrays, they are counted.

        Raises:
            OSError: it cannot be written; nothing is changed.
        """
        arrow, parquet = load("pyarrow"), load("pyarrow.parquet")
        first = next(pieces, None)
        if first is None:
            return None
        shape = first[1].v.shape[1:]
        counted = tuple(f"v{k}" for k in range(math.prod(shape)))
        own = (*OWN, REFUSED)
        columns = tuple(f"{one}_" if one in own else one for one in names) or counted
        kinds = [(name, arrow.int64()) for name in OWN]
        kinds += [(name, arrow.float64()) for name in columns]
        schema = arrow.schema([*kinds, *([(REFUSED, arrow.string())] if names else [])])
        place = self.folder / _plain(source) / f"{day}.{first[0]}.parquet"
        place.parent.mkdir(parents=True, exist_ok=True)
        part = place.with_suffix(".part")
        samples, last, start, stop = 0, first[0], 2**63 - 1, -(2**63)
        with part.open("wb") as file:
            with parquet.ParquetWriter(file, schema, compression="zstd") as writer:
                for block in _blocks(chain([first], pieces)):
                    arrays = [arrow.array(one) for one in block[: len(OWN)]]
                    values = block[len(OWN) :]
                    if names:  # of arrays, infinite is a value: a beam without an echo
                        arrays += [arrow.array(v, mask=~np.isfinite(v)) for v in values]
                        arrays.append(arrow.array(_refused(columns, values), arrow.string()))
                    else:
                        arrays += [arrow.array(v) for v in values]
                    writer.write_table(arrow.Table.from_arrays(arrays, schema=schema))
                    number, _, t, *_ = block
                    samples, last = samples + len(t), int(number[-1])
                    start, stop = min(start, int(t.min())), max(stop, int(t.max()))
            file.flush()
            os.fsync(file.fileno())
        part.replace(place)
        _settled(place.parent)
        of_arrays = () if names else shape
        return Day(str(place.relative_to(self.folder)), digest(place), source, samples, last,
                   of_arrays, start, stop)  # fmt: skip

    def samples(self, source: str, first: int, last: int) -> Iterator[Chunk]:
        """Those of a source with stamps in [first, last] [ns], in order of arrival.

        Raises:
            StoreDamaged: a file is gone, or is not what the log names.
        """
        for day in self.days:
            if day.source == source and day.stop >= first and day.start <= last:
                yield from self._of(day, first, last)

    def _of(self, day: Day, first: int, last: int) -> Iterator[Chunk]:
        path = self.checked(day)
        query = (
            "SELECT * FROM read_parquet(?, file_row_number = true) "
            "WHERE t_ns BETWEEN ? AND ? ORDER BY file_row_number"
        )
        with load("duckdb").connect() as database:
            database.execute("SET TimeZone = 'UTC'; SET enable_progress_bar = false")
            found = database.execute(query, [str(path), first, last]).fetchnumpy()
        number, task, t = (np.asarray(found[name], dtype=np.int64) for name in OWN)
        # by place: DuckDB gives names that differ by case alone others
        names = load("pyarrow.parquet").read_schema(path).names
        columns, held = names[len(OWN) :], list(found.values())[len(OWN) : len(names)]
        told = held.pop() if columns[-1:] == [REFUSED] and held[-1].dtype == object else ()
        v = np.column_stack([np.ma.filled(one.astype(np.float64), np.nan) for one in held])
        for k, text in enumerate(np.ma.filled(told, "")):
            for name in filter(None, text.split(",")):
                v[k, columns.index(name.removeprefix("-"))] = -np.inf if name[0] == "-" else np.inf
        cuts = np.flatnonzero(np.diff(number)) + 1
        for begin, end in zip([0, *cuts], [*cuts, len(t)], strict=True):
            if end > begin:
                part = v[begin:end].reshape(-1, *day.shape) if day.shape else v[begin:end]
                yield Chunk(day.source, t[begin:end], part, int(task[begin]))

    def checked(self, day: Day) -> Path:
        """Where a file is; its hash is looked at once by each process.

        Raises:
            StoreDamaged: it is gone, or is not what the log names.
        """
        path = self.folder / day.file
        if day.file not in self._whole:
            try:
                found = digest(path)
            except OSError as error:
                raise StoreDamaged(
                    f"{path}: {error.strerror}: put it back from a backup: the log names it"
                ) from error
            if found != day.sha256:
                raise StoreDamaged(
                    f"{path}: has hash {found[:12]}, expected {day.sha256[:12]}: put it back from "
                    "a backup"
                )
            self._whole.add(day.file)
        return path

    def verify(self) -> None:
        """Looks at every file anew.

        Raises:
            StoreDamaged: names the first that is gone or not what the log names.
        """
        self._whole.clear()
        for day in self.days:
            self.checked(day)

    def copy_to(self, store: Path) -> None:
        """All files, beside a copy of the store; those that are there already stay."""
        for day in self.days:
            there = Path(f"{store}.days") / day.file
            if there.is_file() and digest(there) == day.sha256:
                continue
            there.parent.mkdir(parents=True, exist_ok=True)
            part = there.with_suffix(".part")
            shutil.copyfile(self.checked(day), part)
            part.replace(there)


def _blocks(pieces: Iterator[tuple[int, Chunk]]) -> Iterator[list[np.ndarray]]:
    """Columns of many pieces at once."""
    waiting: list[tuple[int, Chunk]] = []
    count = 0
    for one in pieces:
        waiting.append(one)
        count += len(one[1].t)
        if count >= PIECE:
            yield _columns(waiting)
            waiting, count = [], 0
    if waiting:
        yield _columns(waiting)


def _refused(columns: Sequence[str], values: Sequence[np.ndarray]) -> list[str | None]:
    """Of each sample, the columns whose value was refused.

    >>> _refused(("v", "x"), [np.array([np.inf, 1.0]), np.array([-np.inf, np.nan])])
    ['v,-x', None]
    """
    found: list[str | None] = [None] * len(values[0])
    for name, v in zip(columns, values, strict=True):
        for k in np.flatnonzero(np.isinf(v)).tolist():
            said = f"-{name}" if v[k] < 0.0 else name
            found[k] = said if found[k] is None else f"{found[k]},{said}"
    return found


def _columns(pieces: Sequence[tuple[int, Chunk]]) -> list[np.ndarray]:
    lengths = [len(chunk.t) for _, chunk in pieces]
    own = [np.repeat([number for number, _ in pieces], lengths),
           np.repeat([chunk.task for _, chunk in pieces], lengths),
           np.concatenate([chunk.t for _, chunk in pieces])]  # fmt: skip
    v = np.concatenate([chunk.v.reshape(len(chunk.t), -1) for _, chunk in pieces])
    return [*(one.astype(np.int64) for one in own), *v.T]


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _plain(source: str) -> str:
    """A source's name as that of a folder."""
    if re.fullmatch(r"[A-Za-z0-9_-]{1,64}", source):
        return source
    return f"source-{hashlib.sha256(json.dumps(source).encode()).hexdigest()[:16]}"


def _settled(folder: Path) -> None:
    """What a folder lists is on the disk."""
    for one in (folder, folder.parent, folder.parent.parent):
        handle = os.open(one, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
