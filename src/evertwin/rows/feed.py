"""From recordings to rows: files become chunks, and chunks rows by the one alignment.

A fold takes the rows as they come (`Feed.stream`), in bounded memory. A fit takes whole tasks
(`Feed.blocks`), from the first to the last motion where the twin file asks for that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from evertwin.config import TwinSpec, files_of
from evertwin.config.read import recorded
from evertwin.config.spec import ArraySpec, SourceSpec
from evertwin.errors import ConfigError, DataError, UsageError
from evertwin.fold import Block, Chunk, Event, concatenate, take
from evertwin.models import Model
from evertwin.rows.alignment import Alignment
from evertwin.rows.crop import cropped
from evertwin.rows.given import COLUMNS, Given, given, unknown
from evertwin.rows.time_scale import doubt, would_fit
from evertwin.sources.clocks.tally import Tally
from evertwin.sources.columns.scans import Lidar
from evertwin.sources.merging import MOST, Excerpt, each_once, merge
from evertwin.sources.numeric.in_memory import Frame, in_memory
from evertwin.sources.recorded import Recorded
from evertwin.sources.recorded_scans import RecordedScans
from evertwin.sync import Feed as Brings

Data: TypeAlias = (
    "str | Path | Sequence[str | Path] | Mapping[str, Any] | Frame | "
    "Sequence[Mapping[str, Any] | Frame] | Block | Iterable[Block] | None"
)
"""A file, files or parts of them (``FILE@START:STOP``), a table with columns by name (a DataFrame,
an Arrow table, a record array, a mapping of columns with ``t`` in seconds: `evertwin.rows.given`
says how they are read) or several, each a recording, ready blocks, or None: the twin file's."""
ALONE = "one row is left to use, and one alone tells nothing"
ENOUGH, FINER = 100, 100
"""Samples that tell how far they are apart; rows of a grid for one of them that are too many."""


@dataclass
class Feed:
    """The rows of recordings for one twin; ``tallies`` count what was wrong with them.

    >>> from evertwin.config.spec import ModelSpec
    >>> from evertwin.machines.mobile import Robot1D
    >>> feed = Feed(TwinSpec("cart", ModelSpec("robot1d")), Robot1D())
    >>> [len(block.t) for block in feed.blocks({"t": [0, 1], "v": [0, 0], "x": [0, 0]})]
    [2]
    """

    spec: TwinSpec
    model: Model
    tallies: dict[str, Tally] = field(default_factory=dict)
    """By source, once it is read."""
    events: list[Event] = field(default_factory=list)
    """What the alignment said of the samples so far."""
    files: dict[str, list[Path]] = field(default_factory=dict)
    """By source, in the order in which they were read."""
    moved: dict[int, int] = field(default_factory=dict)
    """Tasks so far whose stamps were moved behind those of the task before, by how much [ns]."""
    _scans: dict[tuple[Path, ...], RecordedScans] = field(default_factory=dict, init=False)
    """Those that are read."""

    def blocks(self, data: Data = None) -> Iterator[Block]:
        """One block a task, cropped; row numbers and tasks run on over all of them.

        Raises:
            DataError: a file cannot be read, or holds no row that can be used.
        """
        ready = _ready(data)
        if ready is not None:
            yield from ready
            return
        row, number = 0, 0
        for task in _tasks(self.stream(data)):
            kept = cropped(task, self.spec, self.model)
            if kept is not None:
                yield kept._replace(row=row, task=np.full(len(kept.t), number))
                row, number = row + len(kept.t), number + 1
        if row == 0:
            raise DataError(
                "no row is left of the data: check [clock] crop, start and stop, and @START:STOP"
                f"{self.lost}"
            )

    def several(self, data: Data = None) -> Iterator[Block]:
        """`blocks` of recordings that hold more than one row that can be used.

        Raises:
            DataError: one alone, or none, can be.
        """
        rows = 0
        for block in self.blocks(data):
            rows += len(block.t)
            yield block
        if rows == 1 and self.tallies:
            raise DataError(self.why(ALONE))

    def stream(self, data: Data = None) -> Iterator[Block]:
        """The rows as they come, for a fold.

        Raises:
            DataError: a file cannot be read, or holds no row that can be used.
        """
        ready = _ready(data)
        if ready is not None:
            yield from ready
            return
        try:
            feeds = self.brings(data)
            alignment = Alignment.of(self.spec, self.model, feeds, self._lidar(data))
        except ConfigError as error:
            raise ConfigError(f"{self._unfed(data)}{error}") from None
        state, empty = alignment.init(), True
        for chunk in self.chunks(data):
            empty = False
            self._check(chunk)
            state, block, events = alignment.step(state, chunk)
            self.events += events
            if block is not None:
                yield block
        if empty:
            raise DataError(
                "no row is left of the data: its files hold none, or none is in @START:STOP"
                f"{self.lost}"
            )
        state, block, events = alignment.flush(state)
        self.events += events
        if block is not None:
            yield block

    def _unfed(self, data: Data) -> str:
        """The sources that none of the files given went to, and where these went."""
        if data is None or given(self.spec, self.model, data) is not None:
            return ""
        files = files_of(self.spec, [part.path for part in _parts(data)])
        names = [source.name for source in recorded(self.spec)]
        none = ", ".join(names[i] for i, paths in files.items() if not paths)
        went = "; ".join(
            f"{', '.join(path.name for path in paths)} went to source {names[i]}"
            for i, paths in files.items() if paths
        )  # fmt: skip
        tail = f"none to {none}: does [[source]] match tell them apart? "
        return f"{went}, {tail}" if none else ""

    def _check(self, chunk: Chunk) -> None:
        """A grid that is far finer than the samples of a source is a wrong unit of time; so may be
        whole numbers that the twin is too short for."""
        tally = self.tallies[chunk.source]
        step, unit, likely = tally.advance
        if step:
            tally.doubt = doubt(step, unit, self.spec.prediction.horizon, self.model, likely=likely)
            tally.suspect(tally.doubt)
            tally.advance = (0.0, unit, likely)
        rate = self.spec.clock.rate
        if rate is None or len(chunk.t) < ENOUGH:
            return
        apart = 1e-9 * float(np.median(np.diff(chunk.t)))
        if apart * rate > FINER:
            raise DataError(
                f"{chunk.source}: a sample every {apart:.4g} s would become {apart * rate:,.0f} "
                f"rows at {rate:g} Hz: is the unit of its time right ([[source]] time"
                f"{would_fit(apart * rate, unit)}), and [clock] rate?"
            )

    def brings(self, data: Data = None) -> tuple[Brings, ...]:
        """What each source brings."""
        held = given(self.spec, self.model, data)
        read = self._wanted(data) if held is None else [one.source for one in held]
        return tuple(_brought(one) for one in read if isinstance(one, SourceSpec))

    def live(self, named: Sequence[str] = ()) -> tuple[Brings, ...]:
        """What the sources of a running machine bring; without any, one of columns by name."""
        sources = tuple(_brought(source) for source in self.spec.source)
        return sources or (Brings(COLUMNS, tuple(named)),)

    def chunks(self, data: Data = None) -> Iterator[Chunk]:
        """The samples of all sources, merged by stamp.

        Raises:
            DataError: a file cannot be read.
        """
        held = given(self.spec, self.model, data)
        if held is not None:
            yield from merge([self._held(one) for one in held], moved=self.moved)
            return
        parts = _parts(data)
        if all(part.whole for part in parts):
            files = files_of(self.spec, [part.path for part in parts])
            for paths in files.values():
                each_once([Excerpt(path) for path in paths])
            yield from self._merged(files, self.moved)
            return
        each_once(parts)
        task = 0
        for files, part in self._recordings(parts):
            newest = task
            for chunk in part.of(self._merged(files)):
                newest = task + chunk.task + 1
                yield chunk._replace(task=task + chunk.task)
            task = newest

    @property
    def left_out(self) -> tuple[Tally, ...]:
        """The sources of which rows were left out, or something is suspected."""
        return tuple(tally for tally in self.tallies.values() if str(tally))

    @property
    def lost(self) -> str:
        """The same, as the end of a sentence."""
        return "".join(f"; {tally}" for tally in self.left_out)

    def why(self, so: str) -> str:
        """What follows from the rows that were left out, behind them."""
        return "; ".join([*map(str, self.left_out), so])

    def _merged(
        self, files: Mapping[int, tuple[Path, ...]], moved: dict[int, int] | None = None
    ) -> Iterator[Chunk]:
        every = recorded(self.spec)
        sources = [self._reader(every[i], paths).read() for i, paths in files.items() if paths]
        return merge(
            sources, moved=moved, most=1 if self.spec.perception or self.spec.labels else MOST
        )

    def _lidar(self, data: Any) -> Lidar | None:
        """Where the beams of recorded scans look; None: their recording does not say it.

        Raises:
            ConfigError: there are none.
        """
        if self.spec.perception is None or given(self.spec, self.model, data) is not None:
            return None
        files = files_of(self.spec, [part.path for part in _parts(data)])
        every = recorded(self.spec)
        for i, paths in files.items():
            one = self._reader(every[i], paths) if paths else None
            if isinstance(one, RecordedScans) and one.spec.name == self.spec.perception.scan:
                return one.lidar
        raise ConfigError("[perception] makes the pose of scans: give their recording too")

    def _wanted(self, data: Any) -> list[SourceSpec | ArraySpec]:
        """The sources that have files."""
        files = files_of(self.spec, [part.path for part in _parts(data)])
        if not any(files.values()):
            raise UsageError(
                f"{self.spec.name}: no data: name files in [[source]] or give them (--data FILE)"
            )
        every = recorded(self.spec)
        return [every[i] for i, paths in files.items() if paths]

    def _recordings(
        self, parts: Sequence[Excerpt]
    ) -> Iterator[tuple[dict[int, tuple[Path, ...]], Excerpt]]:
        """Parts of recordings: the k-th files of all sources together are one recording."""
        found: dict[int, list[Excerpt]] = {}
        for part in parts:
            files = files_of(self.spec, [part.path])
            found.setdefault(next(i for i, paths in files.items() if paths), []).append(part)
        if len({len(listed) for listed in found.values()}) > 1:
            raise DataError("the sources have different numbers of files: give each the same")
        for together in zip(*found.values(), strict=True):
            if len({(part.start, part.stop) for part in together}) > 1:
                named = ", ".join(str(part.path) for part in together)
                raise UsageError(f"{named}: files of one recording: give each the same @START:STOP")
            yield files_of(self.spec, [part.path for part in together]), together[0]

    def _held(self, one: Given) -> Iterator[Chunk]:
        tally = self._tally(one.source)
        tally.notes += one.notes
        return Recorded.of(one.source, one.recordings, tally).read()

    def _reader(
        self, spec: SourceSpec | ArraySpec, paths: tuple[Path, ...]
    ) -> Recorded | RecordedScans:
        if isinstance(spec, ArraySpec):
            tally = self.tallies.setdefault(spec.name, Tally(spec.name))
            return self._scans.setdefault(paths, RecordedScans(spec, paths, tally))
        self.files.setdefault(spec.name, []).extend(paths)
        return Recorded.of(spec, paths, self._tally(spec))

    def _tally(self, spec: SourceSpec) -> Tally:
        return self.tallies.setdefault(spec.name, Tally(spec.name, spec.left_out))


def _brought(source: SourceSpec) -> Brings:
    """What a source of the twin file brings; its stamps have its offset already."""
    return Brings(source.name, tuple(source.channels), source.slack, source.timeout)


def _ready(data: Any) -> Iterable[Block] | None:
    """Blocks that were given as such.

    Raises:
        UsageError: it is neither these, nor files, nor tables.
    """
    if isinstance(data, Block):
        return (data,)
    if data is None or isinstance(data, str | Path) or in_memory(data) is not None:
        return None
    if isinstance(data, Sequence):
        return data if len(data) > 0 and isinstance(data[0], Block) else None
    if not isinstance(data, Iterator) or hasattr(data, "read"):
        raise UsageError(unknown(data))
    return _blocks(data)


def _blocks(data: Iterator[Any]) -> Iterator[Block]:
    for block in data:
        if not isinstance(block, Block):
            raise UsageError(
                f"data: expected an iterator of blocks, got one of {type(block).__name__}: give "
                "recordings as a list"
            )
        yield block


def _parts(data: Any) -> list[Excerpt]:
    listed = [data] if isinstance(data, str | Path) else data or ()
    return [Excerpt.parse(item) for item in listed]


def _tasks(blocks: Iterable[Block]) -> Iterator[Block]:
    """The same rows, one block a task."""
    waiting: list[Block] = []
    for block in blocks:
        edges = [0, *(np.flatnonzero(np.diff(block.task)) + 1).tolist(), len(block.t)]
        for start, stop in pairwise(edges):
            piece = take(block, start, stop)
            if waiting and int(piece.task[0]) != int(waiting[0].task[0]):
                yield concatenate(waiting)
                waiting = []
            waiting.append(piece)
    if waiting:
        yield concatenate(waiting)
