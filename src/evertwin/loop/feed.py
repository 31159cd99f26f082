"""From recordings to blocks: the rows that a twin folds, task by task.

Where a twin needs whole tasks (a rate, a filter, derived channels, a crop) one task is in memory at
a time; otherwise rows are folded as they are read (`evertwin.loop.stream`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from evertwin.config import TwinSpec, files_of
from evertwin.config.spec import SourceSpec
from evertwin.errors import DataError, UsageError
from evertwin.fold import Block, Chunk
from evertwin.loop.stream import Plan, stream
from evertwin.loop.tasks import Table, is_held, is_measured, recorded_as, rows_of_task
from evertwin.models import Model
from evertwin.sources.dialect import Stated
from evertwin.sources.excerpt import Excerpt
from evertwin.sources.recorded import Cell, Clock, Recorded
from evertwin.sources.tally import Tally

__all__ = ["Data", "Feed"]

Data: TypeAlias = "Sequence[str | Path] | Mapping[str, Any] | Iterable[Block] | None"
"""Files or parts of them (``FILE@START:STOP``), columns by name (with ``t`` in seconds), ready
blocks, or None: the twin file's own."""


Series: TypeAlias = dict[str, tuple[np.ndarray, np.ndarray]]
"""Channel → (stamps, values) of one task."""


@dataclass
class Feed:
    """The rows of recordings for one twin; ``tally`` counts what was wrong with them.

    >>> Feed.__name__
    'Feed'
    """

    spec: TwinSpec
    model: Model
    tally: Tally = field(default_factory=Tally)

    def blocks(self, data: Data = None) -> Iterator[Block]:
        """The rows in order; row numbers and tasks run on over all of them.

        Raises:
            DataError: a file cannot be read, or holds no row that can be used.
        """
        if data is not None and not isinstance(data, Sequence | Mapping):
            yield from data
            return
        if _are_blocks(data):
            yield from data  # type: ignore[misc]
            return
        row, task = 0, 0
        for series in self._tasks(data):
            block = rows_of_task(series, self.spec, self.model, row, task)
            if block is not None:
                yield block
                row, task = row + len(block.t), task + 1
        if row == 0:
            raise DataError(
                "no row is left of the data: check [clock] crop, start and stop, and @START:STOP"
            )

    def stream(self, data: Data = None) -> Iterator[Block]:
        """The same rows for a fold, in bounded memory where nothing needs a whole task.

        Raises:
            DataError: a file cannot be read, or holds no row that can be used.
        """
        if self._needs_tasks(data):
            yield from self.blocks(data)
            return
        sources = self._sources(
            files_of(self.spec, [Excerpt.parse(str(p)).path for p in data or ()])
        )
        specs = [spec for _, spec in sources]
        chunks, widths = [_chunks(*one) for one in sources], [len(s.channels) for s in specs]
        block = None
        for block in stream(chunks, widths, self._plan(specs)):
            yield block
        if block is None:
            raise DataError("no row is left of the data: its files hold none")

    def _needs_tasks(self, data: Any) -> bool:
        spec, clock = self.spec, self.spec.clock
        cropped = clock.crop is not None or clock.start > 0.0 or clock.stop < float("inf")
        whole = cropped or clock.rate is not None or spec.filter is not None or bool(spec.derive)
        whole = whole or not all(is_measured(spec, name) for name in self.model.outputs.names)
        files = data is None or (isinstance(data, Sequence) and not _are_blocks(data))
        return whole or not files or not all(Excerpt.parse(item).whole for item in data or ())

    def _plan(self, sources: Sequence[SourceSpec]) -> Plan:
        spec, model = self.spec, self.model
        names = [name for source in sources for name in source.channels]
        table = Table(np.zeros(1, np.int64), {n: np.array([float(k)]) for k, n in enumerate(names)})
        inputs = [int(table.column(recorded_as(spec, n))[0]) for n in model.inputs.names]
        outputs = [int(table.column(recorded_as(spec, n))[0]) for n in model.outputs.names]
        held = np.array([is_held(spec, n, len(model.states) > 0) for n in model.inputs.names])
        columns = np.array(inputs, dtype=np.int64)
        return Plan(
            np.where(held, columns, -1), np.where(held, -1, columns), len(inputs),
            np.array(outputs, dtype=np.int64), spec.clock.gap,
        )  # fmt: skip

    def _tasks(self, data: Any) -> Iterator[Series]:
        """Channel → (stamps, values), one task after another."""
        if isinstance(data, Mapping):
            yield _columns(data)
            return
        parts = [Excerpt.parse(item) for item in data or ()]
        if not all(part.whole for part in parts):
            yield from self._parts(parts)
            return
        yield from self._of_files(files_of(self.spec, [part.path for part in parts]))

    def _of_files(self, files: Mapping[int, tuple[Path, ...]]) -> Iterator[Series]:
        yield from _by_task([_gathered(source, spec) for source, spec in self._sources(files)])

    def _sources(self, files: Mapping[int, tuple[Path, ...]]) -> list[tuple[Recorded, SourceSpec]]:
        if not any(files.values()):
            raise UsageError(
                f"{self.spec.name}: no data: name files in [[source]] or give them (--data FILE)"
            )
        return [self._recorded(self.spec.source[i], paths) for i, paths in files.items() if paths]

    def _parts(self, parts: Sequence[Excerpt]) -> Iterator[Series]:
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
            origin: int | None = None
            for series in self._of_files(
                {i: (part.path,) for i, part in zip(found, together, strict=True)}
            ):
                opens = min(int(t[0]) for t, _ in series.values())
                origin = opens if origin is None else origin
                kept = together[0].of(series, origin)
                if all(len(t) for t, _ in kept.values()):
                    yield kept

    def _recorded(self, spec: SourceSpec, paths: tuple[Path, ...]) -> tuple[Recorded, SourceSpec]:
        cells = [
            Cell(name, c.column, c.unit, c.scale, c.offset, c.sentinels)
            for name, c in spec.channels.items()
        ]
        cells += [Cell(f"?{column}", column, "1") for column in spec.where]
        time = spec.time
        clock = Clock(time.column, time.unit, time.rate, round(spec.offset * 1e9))
        stated = Stated(spec.header, spec.delimiter, spec.decimal)
        recorded = Recorded(
            spec.name, paths, tuple(cells), clock, spec.task, self.tally, stated, spec.format
        )
        return recorded, spec


def _are_blocks(data: Any) -> bool:
    return isinstance(data, Sequence) and len(data) > 0 and isinstance(data[0], Block)


def _columns(data: Mapping[str, Any]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    if "t" not in data:
        raise DataError("columns: expected a column 't' with seconds from the start")
    t = np.rint(np.asarray(data["t"], dtype=np.float64) * 1e9).astype(np.int64)
    return {k: (t, np.asarray(v, dtype=np.float64)) for k, v in data.items() if k != "t"}


def _gathered(
    source: Recorded, spec: SourceSpec
) -> Iterator[tuple[int, dict[str, tuple[np.ndarray, np.ndarray]]]]:
    """(task, its channels) of one source."""
    waiting: list[Chunk] = []
    for chunk in source.read():
        if waiting and chunk.task != waiting[0].task:
            yield waiting[0].task, _joined(waiting, spec)
            waiting = []
        waiting.append(chunk)
    if waiting:
        yield waiting[0].task, _joined(waiting, spec)


def _chunks(source: Recorded, spec: SourceSpec) -> Iterator[Chunk]:
    """The wanted rows of the channels alone."""
    for chunk in source.read():
        t, v = _wanted(chunk.t, chunk.v, spec) if spec.where else (chunk.t, chunk.v)
        if len(t):
            yield chunk._replace(t=t, v=v[:, : len(spec.channels)])


def _joined(chunks: list[Chunk], spec: SourceSpec) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    t = np.concatenate([chunk.t for chunk in chunks])
    v = np.concatenate([chunk.v for chunk in chunks])
    t, v = _wanted(t, v, spec)
    return {name: (t, v[:, k].copy()) for k, name in enumerate(spec.channels)}


def _wanted(t: np.ndarray, v: np.ndarray, spec: SourceSpec) -> tuple[np.ndarray, np.ndarray]:
    """The rows whose columns have one of the values that ``where`` names."""
    names = [*spec.channels, *(f"?{column}" for column in spec.where)]
    keep = np.ones(len(t), dtype=np.bool_)
    for column, wanted in spec.where.items():
        keep &= np.isin(v[:, names.index(f"?{column}")], np.array(wanted, dtype=np.float64))
    return t[keep], v[keep]


def _by_task(
    sources: list[Iterator[tuple[int, dict[str, tuple[np.ndarray, np.ndarray]]]]],
) -> Iterator[dict[str, tuple[np.ndarray, np.ndarray]]]:
    """The k-th tasks of all sources together."""
    while True:
        parts = [next(source, None) for source in sources]
        if all(part is None for part in parts):
            return
        if any(part is None for part in parts):
            raise DataError("the sources have different numbers of tasks: give each the same files")
        together: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for part in parts:
            together.update(part[1])  # type: ignore[index]
        if all(len(t) for t, _ in together.values()):
            yield together
