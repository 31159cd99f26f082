"""From recordings to blocks: the rows that a twin folds, task by task.

Where a twin needs whole tasks (a rate, a filter, derived channels, a crop) one task is in memory at
a time; otherwise chunks pass through `evertwin.sync.Align` as they are read.
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
from evertwin.models import Model
from evertwin.sources.dialect import Stated
from evertwin.sources.recorded import Cell, Clock, Recorded
from evertwin.sources.tally import Tally
from evertwin.twin.tasks import rows_of_task

__all__ = ["Data", "Feed"]

Data: TypeAlias = "Sequence[str | Path] | Mapping[str, Any] | Iterable[Block] | None"
"""Files, columns by name (with ``t`` in seconds), ready blocks, or None: the twin file's own."""


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
        if isinstance(data, Sequence) and data and isinstance(data[0], Block):
            yield from data  # type: ignore[misc]
            return
        row, task = 0, 0
        for series in self._tasks(data):
            block = rows_of_task(series, self.spec, self.model, row, task)
            if block is not None:
                yield block
                row, task = row + len(block.t), task + 1
        if row == 0:
            raise DataError("no row is left of the data: check [clock] crop, start and stop")

    def _tasks(self, data: Any) -> Iterator[dict[str, tuple[np.ndarray, np.ndarray]]]:
        """Channel → (stamps, values), one task after another."""
        if isinstance(data, Mapping):
            yield _columns(data)
            return
        files = files_of(self.spec, () if data is None else data)
        if not any(files.values()):
            raise UsageError(
                f"{self.spec.name}: no data: name files in [[source]] or give them (--data FILE)"
            )
        sources = [
            self._recorded(self.spec.source[i], paths) for i, paths in files.items() if paths
        ]
        yield from _by_task([_gathered(source, spec) for source, spec in sources])

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


def _joined(chunks: list[Chunk], spec: SourceSpec) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    t = np.concatenate([chunk.t for chunk in chunks])
    v = np.concatenate([chunk.v for chunk in chunks])
    names = [*spec.channels, *(f"?{column}" for column in spec.where)]
    keep = np.ones(len(t), dtype=np.bool_)
    for column, wanted in spec.where.items():
        keep &= np.isin(v[:, names.index(f"?{column}")], np.array(wanted, dtype=np.float64))
    t, v = t[keep], v[keep]
    return {name: (t, v[:, k].copy()) for k, name in enumerate(spec.channels)}


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
