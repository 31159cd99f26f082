"""A run whose samples are pushed as they come.

They take the way of recorded ones: stored (`Live.keep`), aligned and folded (`Live.fold`), each
decision one transaction. What is stored becomes durable in its order, with all that waits then
(group commit): a sample no later than what is said of it, yet after `Live.push` has returned. Who
answers for samples flushes the store between `Live.keep` and its answer, and lets one thread keep
while another folds. After a crash the run goes on from its newest checkpoint:
the samples that the store has from there on are folded again, with the answers that the log has, so
that the twin stands where it stood. The same samples from a file give the same rows, records and
versions.

Samples that come faster than they could be folded one by one are folded together: what comes within
`TOGETHER` of the last fold waits for the next sample after it, for the row of a beat, or for
somebody who looks (`Live.settle`). So decisions are never late, and where rows are cut changes no
bit. A store that outlives the process takes each sample at once. Arrays (scans, images) are stored
and make no rows, unless ``[perception]`` makes a pose of them.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, TypeAlias

import numpy as np

from evertwin.engine import Engine, InProcess
from evertwin.errors import DataError
from evertwin.features.images.confusion_drift import DRIFTED
from evertwin.features.perception import CAUSES
from evertwin.features.tables.furniture import FURNISHED
from evertwin.fold import Block, Chunk, Event
from evertwin.ledger.begun import Begun
from evertwin.ledger.ledger import Ledger
from evertwin.loop.loading import FeedState, Rate
from evertwin.loop.observer import Observer, succeeded
from evertwin.loop.run import Run, settings_hash
from evertwin.models.form import Version
from evertwin.outcome.course.changes import changes
from evertwin.outcome.headline import also_pinned, headline
from evertwin.outcome.open.on_trial import OpenTrial, open_trial
from evertwin.outcome.result import OutputFigures, RunResult
from evertwin.outcome.view import View
from evertwin.rows.alignment import Alignment, AlignmentState
from evertwin.rows.by_name import ByName
from evertwin.rows.feed import Feed as Recorded
from evertwin.rows.given import tabled
from evertwin.rows.rate import ENOUGH, rate_of
from evertwin.rows.samples import Numbered
from evertwin.rows.samples import Samples as Kept
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import Saved, TwinState
from evertwin.sources.numeric.in_memory import Frame
from evertwin.store import Checkpoint
from evertwin.sync import Feed

Samples: TypeAlias = "Chunk | Mapping[str, Any] | Frame"
"""Of one source: as they came, or a table of them."""
SOURCES = "sources"
TOGETHER = 0.01
"""Seconds after a fold in which samples wait for each other."""
MOST = 256
"""Samples that wait at most."""


@dataclass
class Live:
    """The run. ``feeds``: what its sources bring.

    >>> from evertwin import TwinSpec
    >>> from evertwin.config.spec import ModelSpec
    >>> from evertwin.ledger import Versions
    >>> from evertwin.setup import model_of
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
    _number: int = field(default=0, init=False)
    """Of the newest among them, in the store."""
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
    _untold: list[Event] = field(default_factory=list, init=False)
    """What is said once was said until then."""
    _task: int | None = field(default=None, init=False)
    """Number of the first task; a run counts its own from zero."""
    _rate: float = field(default=np.nan, init=False)
    _left: Begun | None = field(default=None, init=False)
    """The run that was cut off and goes on."""
    _first: int = field(default=1, init=False)
    """Number of the run's first sample in the store."""
    _by_name: ByName | None = field(default=None, init=False)
    """Reads what is pushed as columns by name."""
    _changed: tuple[tuple[int, int], str] = field(default=((0, 0), ""), init=False)
    """Live version and number of events, and what was told of them."""
    _began: float = field(default_factory=time.perf_counter, init=False)

    def __post_init__(self) -> None:
        self._observer = Observer(self.setup)
        self._alignment = Alignment.of(self.setup.spec, self.setup.model, self.feeds)
        self._aligned = self._alignment.init()
        self._samples = Kept(self.ledger.store, self.setup.spec)
        if self.lasting:
            self._go_on()

    def _go_on(self) -> None:
        """What the store has and no run has ended: a run that was cut off, or its beginning."""
        left, store, came = self.ledger.unfinished, self.ledger.store, None
        if left is not None and SOURCES in left.evidence:
            first = int(left.evidence["first_chunk"])
            saved = store.restore(Saved((), Rate(0.0)), left.number)
            oldest = next((number for number, _ in store.read_chunks(first)), first)
            if self._told.items() <= left.evidence.items() and (saved or oldest == first):
                self._left, self._first = left, first
                came = None if saved is None else self._begin(saved.state.feed.rate)
            else:  # with other settings, or without its samples, it cannot be repeated
                self._first = store.chunks + 1
        else:  # what was pushed before its run began is of the run that begins now
            ended = (run.ended or {} for run in self.ledger.runs)
            self._first = 1 + max((int(one.get("chunks", 0)) for one in ended), default=0)
        # a checkpoint before the next sample is of those that this one was of
        self._number = self._first - 1 if came is None else came.chunks
        for number, chunk in store.read_chunks(self._number + 1):
            self._number = number
            if not self._aside(chunk):
                self._align(chunk)

    @property
    def _told(self) -> dict[str, Any]:
        """What a run has in common with the one that it goes on from."""
        settings = settings_hash(self.setup.spec, self.feeds)
        return {"settings": settings, SOURCES: tuple(feed.name for feed in self.feeds)}

    @classmethod
    def of(
        cls, setup: Setup, ledger: Ledger, first: Sequence[Any], engine: Engine, lasting: bool
    ) -> Live:  # fmt: skip
        """The run of a machine's sources; of the ``first`` samples where the twin file has none."""
        feed = Recorded(setup.spec, setup.model)
        tables = [one for one in first if not isinstance(one, Chunk)]
        named = [n for one in tables for n in tabled(setup.spec, setup.model, one).source.channels]
        return cls(setup, ledger, feed.live(named), engine, lasting)

    def push(self, samples: Any) -> None:
        """More samples of one source (`Samples`), in the order in which they came.

        Raises:
            DataError: the source is unknown, or has another number of columns.
            UsageError: they are no samples.
            StoreError: they could not be stored; then nothing was folded.
        """
        self.fold(self.keep(samples if isinstance(samples, Chunk) else self._chunk(samples)))

    def keep(self, chunk: Chunk) -> Numbered:
        """Samples into the store, for `fold`: durable with its next flush. In any thread, one call
        after the other.

        Raises:
            DataError: the source is unknown, or has another number of columns.
            StoreError: they could not be stored.
        """
        # whoever pushed them may use the arrays again
        chunk = chunk._replace(t=chunk.t.copy(), v=chunk.v.copy())
        if self._aside(chunk):
            return self._samples.keep(chunk)
        self._alignment.check(chunk)  # what does not fit is neither stored nor folded
        return self._samples.keep(chunk) if self.lasting else Numbered(0, chunk)

    def fold(self, kept: Numbered, *, more: bool = False) -> None:
        """What was kept, in the order in which it was; ``more`` follows at once."""
        self._number, chunk = kept
        if self._aside(chunk):
            return
        self._pushed.append(chunk)
        self._room -= len(chunk.t)
        if more:
            waits = len(self._pushed) < MOST
        else:
            waits = self._room > 0 and time.perf_counter() < self._folded + TOGETHER
        if not (waits and chunk.task == self._newest):
            self.settle()

    def _aside(self, chunk: Chunk) -> bool:
        """Is a chunk of arrays that no row is made of?"""
        return self._samples.is_array(chunk) and not self._alignment.takes(chunk.source)

    def settle(self) -> None:
        """Folds the samples that wait."""
        pushed, self._pushed = self._pushed, []
        if not pushed:
            return
        groups = groupby(pushed, lambda chunk: (chunk.source, chunk.task))
        chunks = tuple(_joined(*alike) for _, alike in groups)
        for chunk in chunks:
            self._align(chunk)
        if self._run is not None and self._state is not None:
            every = self._run.setup.beat.every
            # what is seen at a row is told within a beat, also if several samples come at once
            self._room = min(-self._state.row % every + 1, max(3 * every // 4, 1), MOST)
            self._save()
        self._newest, self._folded = pushed[-1].task, time.perf_counter()

    def _save(self, *, due: bool = False) -> None:
        assert self._run is not None and self._state is not None
        task = 0 if self._task is None else self._task
        feed = FeedState(self._rate, task, self._aligned)
        self._run.save(self._state, feed, due=due, chunks=self._number)

    def _chunk(self, columns: object) -> Chunk:
        """Columns by name as samples of the one source.

        Raises:
            DataError: there are several sources, or a column lacks.
            UsageError: they are no columns by name.
        """
        if len(self.feeds) != 1:
            names = ", ".join(feed.name for feed in self.feeds)
            raise DataError(f"columns by name: expected one source, there are {names}: push chunks")
        self._by_name = self._by_name or ByName(self.setup.spec, self.setup.model, self.feeds[0])
        return self._by_name(columns)

    def _align(self, chunk: Chunk) -> None:
        self._aligned, block, events = self._alignment.step(self._aligned, chunk)
        self._take(block, events)

    def _take(self, block: Block | None, events: Sequence[Event]) -> None:
        if block is not None:
            self._task = int(block.task[0]) if self._task is None else self._task
            numbered = block._replace(task=block.task - self._task) if self._task else block
            self._waiting.append(numbered)
        if self._run is None and self._may_begin():
            self._begin(rate_of(self._waiting))
        if self._run is None:
            kept = (*DRIFTED, *CAUSES, *FURNISHED)
            self._untold += [event for event in events if event.kind in kept]
        else:
            self._step()
            events, self._untold = (*self._untold, *events), []
            if events:
                self._run.tell(self._run.ledger.at, events)

    def _may_begin(self) -> bool:
        rows = sum(len(part.t) for part in self._waiting)
        known = self.setup.spec.clock.rate is not None or not self.setup.times
        return rows > 0 and (known or rows >= ENOUGH)

    def _begin(self, rate: float | None) -> Checkpoint | None:
        """The run begins, or goes on from the checkpoint that is returned."""
        self._rate = np.nan if rate is None else rate
        setup = self.setup.at(None if np.isnan(self._rate) else self._rate)
        run = Run(
            setup, self.ledger, self._observer, self.engine, live=self.engine.workers > 0,
            pushed=True,
        )  # fmt: skip
        evidence = {**self._told, "first_chunk": self._first}
        feed = FeedState(0.0, 0, self._alignment.init())
        self._state, found = run.begin_pushed(self._left, evidence, feed, lasting=self.lasting)
        if found is not None:
            _, self._task, self._aligned = found.state.feed
        self._run = run
        return found

    def _step(self) -> None:
        assert self._run is not None and self._state is not None
        for block in self._waiting:
            self._state = self._run.step(self._state, block)
        self._waiting.clear()

    def view(self, rows: int = 1000) -> View:
        """The newest rows: measured, predicted, band, mark, version."""
        self.settle()
        return View.of(self._observer.newest(rows), self.setup.model)

    def between(self, first: int, last: int) -> View:
        """Rows stamped in [first, last] [ns]; of those long past every second, fourth … one."""
        self.settle()
        return View.of(self._observer.between(first, last), self.setup.model)

    @property
    def outcome(self) -> tuple[str, Mapping[str, OutputFigures]]:
        """What came of it so far, in a sentence or a few, and the figures behind it."""
        if self._run is None or self._state is None:
            rows = sum(len(part.t) for part in self._waiting)
            told = (
                f": the first {ENOUGH} tell how often they come, {rows} did, or [clock] rate does"
            )
            return f"No rows yet{told if rows else ''}.", {}
        setup, found = self._run.setup, self._observer.figures(self._state)
        measured = int(np.isfinite(self.view().measured).any(axis=1).sum())
        events = self._observer.events
        said = headline(setup, found, self._succeeded, events, self.trial, measured)
        agenda, live = self._state.agenda, self._state.live.version
        return also_pinned(said, live, pinned=agenda.pinned), found

    @property
    def changed(self) -> str:
        """What is other in the live version than in that before; nothing: nothing is."""
        if self._state is None or not self._state.live.version:
            return ""
        at = self._state.live.version, len(self._observer.events)
        if self._changed[0] != at:
            self._changed = at, changes(self.setup, self._succeeded, self._observer.events)
        return self._changed[1]

    @property
    def _succeeded(self) -> tuple[Version, ...]:
        """The live version, and that which it replaced."""
        assert self._state is not None
        versions = self.ledger.versions
        return succeeded(versions, versions[self._state.live.version], self._observer.events)

    @property
    def judged(self) -> str:
        """Has the live version been found within what is asked: ``held``, ``not yet``, or
        ``nothing asked``?"""
        if not np.isfinite(self.setup.requirement):
            return "nothing asked"
        return "held" if self._state is not None and self._state.agenda.held else "not yet"

    @property
    def at_rate(self) -> Setup | None:
        """The setup at the rate of the data; None: that is not known yet."""
        return None if self._run is None else self._run.setup

    @property
    def trial(self) -> OpenTrial | None:
        """The challenger that is on trial, if one is."""
        if self._run is None or self._state is None:
            return None
        return open_trial(self._run.setup, self.ledger.versions, self._state)

    def rest(self) -> None:
        """A checkpoint now, so that whoever goes on has nothing to fold again."""
        self.settle()
        if self._run is not None and self._state is not None:
            self._save(due=True)
        self.ledger.store.flush()

    def finish(self) -> RunResult:
        """The end of the samples: what waits is folded, open work is answered.

        Raises:
            UsageError: nothing was pushed.
        """
        self.settle()
        self._aligned, block, events = self._alignment.flush(self._aligned)
        self._take(block, events)
        if self._run is None:
            self._begin(rate_of(self._waiting))
            self._take(None, ())
        assert self._run is not None and self._state is not None
        return self._run.ended(self._state, self._began)


def _joined(first: Chunk, *more: Chunk) -> Chunk:
    """Samples of one source and task, one after the other."""
    if not more:
        return first
    t, v = zip((first.t, first.v), *((c.t, c.v) for c in more), strict=True)
    return first._replace(t=np.concatenate(t), v=np.concatenate(v))
