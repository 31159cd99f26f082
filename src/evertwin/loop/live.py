"""A run whose samples are pushed as they come.

They take the way of recorded ones: stored, aligned, folded, each decision one transaction. After a
crash the samples of the run are folded again from its first, with the answers that the log has, so
that the twin stands where it stood. The same samples from a file give the same rows, records and
versions.

Samples that come faster than they could be folded one by one are folded together: what comes within
`TOGETHER` of the last fold waits for the next sample after it, for the row of a beat, or for
somebody who looks (`Live.settle`). So decisions are never late, and where rows are cut changes no
bit. A store that outlives the process has each sample at once.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from evertwin.engine import Engine, InProcess
from evertwin.errors import DataError
from evertwin.fold import Block, Chunk, Event
from evertwin.loop.alignment import Alignment, AlignmentState
from evertwin.loop.feed import Feed as Recorded
from evertwin.loop.feed import chunk_of
from evertwin.loop.ledger import Ledger
from evertwin.loop.observer import Observer
from evertwin.loop.rate import ENOUGH, rate_of
from evertwin.loop.result import RunResult
from evertwin.loop.run import Run, settings_hash
from evertwin.loop.setup import Setup
from evertwin.loop.twin_state import TwinState
from evertwin.store import Batch
from evertwin.sync import Feed
from evertwin.types import Marks, Outputs, Stamps

SOURCES = "sources"
TOGETHER = 0.01
"""Seconds after a fold in which samples wait for each other."""
MOST = 256
"""Samples that wait at most."""


class View(NamedTuple):
    """The newest rows of a run.

    >>> View._fields[:3]
    ('row', 't', 'measured')
    """

    row: np.ndarray
    """Numbers, int64 (n,)."""
    t: Stamps
    measured: Outputs
    predicted: Outputs
    band: Outputs
    """Standard deviation of what is measured around the prediction, (n, ny)."""
    mark: Marks
    """`Mark` of each output, (n, ny)."""
    version: np.ndarray
    """Version that predicted the row, int64 (n,)."""


@dataclass
class Live:
    """The run. ``feeds``: what its sources bring.

    >>> from evertwin import TwinSpec
    >>> from evertwin.config.spec import ModelSpec
    >>> from evertwin.loop import Versions, model_of
    >>> from evertwin.store import SqliteStore
    >>> spec = TwinSpec("cart", ModelSpec("robot1d"))
    >>> setup = Setup(spec, model_of(spec, None))
    >>> ledger = Ledger(SqliteStore(":memory:"), Versions(setup.model), "cart")
    >>> live = Live(setup, ledger, (Feed("log", ("v", "x")),))
    >>> live.push(Chunk("log", np.array([0, 10**9]), np.array([[0.1, 0.0], [0.1, 0.1]])))
    >>> live.view(5).measured[:, 0].tolist()
    [0.0, 0.1]
    """

    setup: Setup
    ledger: Ledger
    feeds: Sequence[Feed]
    engine: Engine = field(default_factory=InProcess)
    """Where slow work runs: in this process, rows wait for it as in a recorded run; with workers
    they never do."""
    lasting: bool = True
    """Does the store outlive this process?"""
    _pushed: list[Chunk] = field(default_factory=list, init=False)
    """Samples that are not folded yet."""
    _room: int = field(default=0, init=False)
    """Samples that may wait before a beat is due."""
    _folded: float = field(default=-np.inf, init=False)
    """When the last fold ended."""
    _newest: int | None = field(default=None, init=False)
    """Task of the last sample that was folded: another one begins with a beat."""
    _observer: Observer = field(init=False)
    _run: Run | None = field(default=None, init=False)
    _state: TwinState | None = field(default=None, init=False)
    _aligned: AlignmentState = field(init=False)
    _waiting: list[Block] = field(default_factory=list, init=False)
    """Rows until the rate of the data is known."""
    _task: int | None = field(default=None, init=False)
    """Number of the first task; a run counts its own from zero."""
    _began: float = field(default_factory=time.perf_counter, init=False)

    def __post_init__(self) -> None:
        self._observer = Observer(self.setup)
        self._alignment = Alignment.of(self.setup.spec, self.setup.model, self.feeds)
        self._aligned = self._alignment.init()
        left = self.ledger.unfinished
        if left is not None and SOURCES in left.evidence:
            self._first = int(left.evidence["first_chunk"])
            for _, chunk in list(self.ledger.store.read_chunks(self._first)):
                self._fold(chunk)
        else:
            numbers = [number for number, _ in self.ledger.store.read_chunks()]
            self._first = 1 + max(numbers, default=0)

    @classmethod
    def of(
        cls, setup: Setup, ledger: Ledger, samples: Chunk | Mapping[str, Any], engine: Engine,
        lasting: bool,
    ) -> Live:  # fmt: skip
        """The run of a machine's sources; of the first ``samples`` where the twin file has none."""
        named = () if isinstance(samples, Chunk) else tuple(n for n in samples if n != "t")
        return cls(setup, ledger, Recorded(setup.spec, setup.model).live(named), engine, lasting)

    def push(self, samples: Chunk | Mapping[str, Any]) -> None:
        """More samples of one source, in the order in which they came; or columns by name.

        Raises:
            DataError: the source is unknown, or has another number of columns.
            StoreError: they could not be stored; then nothing was folded.
        """
        chunk = samples if isinstance(samples, Chunk) else self._chunk(samples)
        self._alignment.align.check(chunk)  # what does not fit is neither stored nor folded
        if self.lasting:
            self.ledger.store.commit(Batch(chunks=(chunk,)), wait=False)
        self._pushed.append(chunk)
        self._room -= len(chunk.t)
        waits = self._room > 0 and time.perf_counter() < self._folded + TOGETHER
        if waits and chunk.task == self._newest:
            # whoever pushed them may use the arrays again
            self._pushed[-1] = chunk._replace(t=chunk.t.copy(), v=chunk.v.copy())
        else:
            self.settle()

    def settle(self) -> None:
        """Folds the samples that wait."""
        pushed, self._pushed = self._pushed, []
        if not pushed:
            return
        groups = groupby(pushed, lambda chunk: (chunk.source, chunk.task))
        chunks = tuple(_joined(*alike) for _, alike in groups)
        if not self.lasting:
            self.ledger.store.commit(Batch(chunks=chunks), wait=False)
        for chunk in chunks:
            self._fold(chunk)
        if self._run is not None and self._state is not None:
            every = self._run.setup.beat.every
            # what is seen at a row is told within a beat, also if several samples come at once
            self._room = min(-self._state.row % every + 1, max(3 * every // 4, 1), MOST)
        self._newest, self._folded = pushed[-1].task, time.perf_counter()

    def _chunk(self, columns: Mapping[str, Any]) -> Chunk:
        """Columns by name as samples of the one source.

        Raises:
            DataError: there are several sources, or a column lacks.
        """
        if len(self.feeds) != 1:
            names = ", ".join(feed.name for feed in self.feeds)
            raise DataError(f"columns by name: expected one source, there are {names}: push chunks")
        feed = self.feeds[0]
        lacking = [name for name in ("t", *feed.channels) if name not in columns]
        if lacking:
            raise DataError(f"columns: expected {', '.join(lacking)} too, got {', '.join(columns)}")
        return chunk_of({name: columns[name] for name in ("t", *feed.channels)}, feed.name)

    def _fold(self, chunk: Chunk) -> None:
        self._aligned, block, events = self._alignment.step(self._aligned, chunk)
        self._take(block, events)

    def _take(self, block: Block | None, events: Sequence[Event]) -> None:
        if block is not None:
            self._task = int(block.task[0]) if self._task is None else self._task
            numbered = block._replace(task=block.task - self._task) if self._task else block
            self._waiting.append(numbered)
        if self._run is None and self._may_begin():
            self._begin()
        if self._run is not None:
            self._step()
            if events:
                self._run.tell(self._run.ledger.at, events)

    def _may_begin(self) -> bool:
        rows = sum(len(part.t) for part in self._waiting)
        known = self.setup.spec.clock.rate is not None or not self.setup.times
        return rows > 0 and (known or rows >= ENOUGH)

    def _begin(self) -> None:
        setup = self.setup.at(rate_of(self._waiting))
        workers = self.engine.workers > 0
        self._run = Run(setup, self.ledger, self._observer, self.engine, live=workers)
        settings = settings_hash(setup.spec)
        evidence = {SOURCES: [feed.name for feed in self.feeds], "first_chunk": self._first}
        self._state = self._run.begin_live(settings, evidence)

    def _step(self) -> None:
        assert self._run is not None and self._state is not None
        for block in self._waiting:
            self._state = self._run.step(self._state, block)
        self._waiting.clear()

    def view(self, rows: int = 1000) -> View:
        """The newest rows: measured, predicted, band, mark, version."""
        self.settle()
        columns = self._observer.trace.columns()
        if not columns:
            ny = len(self.setup.model.outputs)
            none, stamps = np.zeros((0, ny)), np.zeros(0, dtype=np.int64)
            return View(stamps, stamps, none, none, none, none.astype(np.uint8), stamps)
        kept = {name: column[-rows:].copy() for name, column in columns.items()}
        return View(
            kept["row"], kept["t"], kept["measured"], kept["predicted"], kept["sigma"],
            kept["mark"], kept["version"],
        )  # fmt: skip

    def finish(self) -> RunResult:
        """The end of the samples: what waits is folded, open work is answered.

        Raises:
            UsageError: nothing was pushed.
        """
        self.settle()
        self._aligned, block, events = self._alignment.flush(self._aligned)
        self._take(block, events)
        if self._run is None:
            self._begin()
            self._take(None, ())
        assert self._run is not None and self._state is not None
        return self._run.ended(self._state, time.perf_counter() - self._began)


def _joined(first: Chunk, *more: Chunk) -> Chunk:
    """Samples of one source and task, one after the other."""
    if not more:
        return first
    t, v = zip((first.t, first.v), *((c.t, c.v) for c in more), strict=True)
    return first._replace(t=np.concatenate(t), v=np.concatenate(v))
