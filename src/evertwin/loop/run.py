"""One run of a twin over recorded rows: blocks into the driver, what it says into the store.

A run is repeated as often as it takes: where the rows are those of a run that the store knows, it
goes on from its newest checkpoint, and what the log has already is compared with it and passed over
(`evertwin.ledger.seen`, `evertwin.ledger.run_log`). Checkpoints are copied at the end of a piece
and written by the store's thread while the fold goes on.
"""

from __future__ import annotations

import hashlib
import logging
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

from evertwin.config import TwinSpec
from evertwin.engine import Engine, InProcess
from evertwin.errors import DataError, ModelError, StoreError, UsageError
from evertwin.features.images.confusion_drift import DRIFTED
from evertwin.features.perception import PERCEIVED
from evertwin.fold import Answer, Block, Event, Record, canonical, copy
from evertwin.ledger.begun import Begun
from evertwin.ledger.fingerprint import Followed as Prints
from evertwin.ledger.ledger import Ledger
from evertwin.ledger.run_log import RunLog
from evertwin.ledger.seen import Place, find, later, rest
from evertwin.loop.carried import carried
from evertwin.loop.decisions.follow import Followed
from evertwin.loop.driver import Driver
from evertwin.loop.observer import Observer
from evertwin.loop.retold import Retold
from evertwin.outcome.headline import first_of_rows
from evertwin.outcome.open.faults import KINDS, open_faults
from evertwin.outcome.open.unperceived import unperceived
from evertwin.outcome.result import RunResult
from evertwin.rows.feed import ALONE, Data, Feed
from evertwin.rows.rate import measured
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import Saved, TwinState
from evertwin.store import Batch, Checkpoint
from evertwin.sync import Feed as Brings

log = logging.getLogger("evertwin")
SECONDS = 5.0
"""Time from checkpoint to checkpoint where no rows are given: what a crash costs at most."""
SHARE = 20.0
"""A checkpoint waits at least this many times as long as copying the last one took."""
ASIDE = {
    "name", "schema", "source", "array", "derive", "engine", "store", "indicator", "prognosis",
    "work", "folder", "file", "contents",
}  # fmt: skip
"""Settings that do not change what the fold makes of rows."""


def settings_hash(spec: TwinSpec, feeds: Sequence[Brings] = ()) -> str:
    """Hash of all settings that the fold of given rows depends on; of given samples with ``feeds``.

    >>> from evertwin.config.spec import ModelSpec
    >>> spec = TwinSpec("cart", ModelSpec("robot1d"))
    >>> settings_hash(spec) == settings_hash(replace(spec, name="lift"))
    True
    """
    told = {f.name: getattr(spec, f.name) for f in fields(spec) if f.name not in ASIDE}
    told |= {"feeds": feeds, "derive": spec.derive} if feeds else {}
    return hashlib.sha256(canonical(told).encode()).hexdigest()


OF_ROWS = ("gap", "leapt", "unknown", *PERCEIVED, *DRIFTED)
"""Kinds of events of the alignment that are told beside those of a run."""


class _Come(NamedTuple):
    """What a checkpoint says of how far its run had come."""

    task: int
    elapsed: int


@dataclass
class Run:
    """A run at work.

    >>> Run.__name__
    'Run'
    """

    setup: Setup
    ledger: Ledger
    observer: Observer
    engine: Engine = field(default_factory=InProcess)
    every: int = 0
    """Rows from checkpoint to checkpoint; 0: by the time they take."""
    live: bool = False
    """Are answers to slow work taken when they are there, and never waited for?"""
    pushed: bool = False
    """Are its samples pushed? Then the store has them, and who pushes them says when to `save`."""
    anew: bool = field(default=False, init=False)
    """Does it go on from nothing, whatever the store has seen?"""
    _handed: bool = field(default=False, init=False)
    """Does it begin with what the run before hands on, and is this to be kept still?"""
    log: RunLog = field(init=False)
    driver: Driver = field(init=False)
    _prints: Prints = field(default_factory=Prints, init=False)
    _from: int = field(default=0, init=False)
    """Row that the run went on from."""
    _lost: bool = field(default=False, init=False)
    """Is it over, and what it began with lost? Then its log says what came of it (`Retold`)."""
    _kept: int = field(default=0, init=False)
    """Row of the last checkpoint."""
    _due: float = field(default=0.0, init=False)
    """When the next one is due."""
    _lasting: bool = field(default=False, init=False)
    """Are there any?"""

    def play(self, data: Data, *, anew: bool, lasting: bool) -> RunResult:
        """The rows of ``data`` that no run has had yet; or the run that has had them, again.

        Args:
            data: as `Feed` takes it.
            anew: a run of its own, whatever the store has seen.
            lasting: does the store outlive this process? Else nothing is looked for.

        Raises:
            DataError: a recording cannot be read.
            ModelError: the model's step raised something at every row.
            StoreError: the log has something else of this run.
        """
        began = time.perf_counter()
        looked, feed = self._feed(), self._feed()
        place, settings = Place(None, 0), settings_hash(self.setup.spec)
        if lasting and not anew and not isinstance(data, Iterator):
            place = find(self.ledger, looked.stream(data), settings, looked.moved)
        self._give_up(place.run, settings)
        self.anew, self._lasting = anew, lasting or self.every > 0
        self._due = began + SECONDS
        rate, blocks = measured(later(feed.stream(data), place))
        self.setup = self.setup.at(rate)
        try:
            state, found = self._begun(place.run, {"settings": settings})
        except UsageError as error:
            if rate is None and (
                feed.files or feed.left_out
            ):  # there is no rate because there are no rows
                raise DataError(feed.why(f"{ALONE}: {error}")) from error
            raise
        again = place.run is not None and place.run.over
        over = again and found is not None and not self.log.repeats
        for block in () if over else blocks:
            state = self.step(state, block)
        result = self.ended(state, began, over=over)
        if result.failed and result.failed.all:
            raise ModelError(str(result.failed))
        had = looked if over else feed
        aligned = [
            replace(event, row=event.row - place.offset, time=event.time - place.moved)
            for event in had.events
            if event.kind in (*OF_ROWS, *KINDS) and event.row >= place.offset
        ]
        first = (*open_faults(aligned).values(), *unperceived(aligned))
        said = first_of_rows(" ".join((*first, result.headline)), had.left_out)
        events = tuple(sorted((*aligned, *result.events), key=lambda event: event.row))
        return replace(
            result,
            began=result.samples if again else result.began,
            left_out=had.left_out,
            passed=place.offset,
            headline=said,
            events=events,
            local=any(tally.local for tally in had.tallies.values()),
        )

    def ended(self, state: TwinState, began: float, *, over: bool = False) -> RunResult:
        """The end of the run (``over``: it had ended before) and what came of it.

        Args:
            began: `time.perf_counter` at its start.
        """
        if not over:
            state = self._finished(state)
        self.log.end()
        seconds = time.perf_counter() - began
        result = self.observer.result(self.driver, state, seconds)
        log.info("%s: %d rows in %.2f s", self.setup.spec.name, state.row, seconds)
        return replace(result, began=self._from)

    def begin_pushed(
        self, known: Begun | None, evidence: dict[str, Any], feed: object, *, lasting: bool
    ) -> tuple[TwinState, Checkpoint | None]:
        """The run that was cut off goes on, from its checkpoint if it has one; or a new one begins.

        Args:
            known: the run that was cut off.
            evidence: of a new one.
            feed: what its checkpoints hold beside the twin's state, for its shape.
            lasting: does the store outlive this process?
        """
        self._lasting = lasting
        self._give_up(known, evidence["settings"], evidence["first_chunk"])
        state, found = self._begun(known, evidence, feed)
        if known is None:
            self.log.say(0, ())  # the run is in the log before its first row
        return state, found

    def _feed(self) -> Feed:
        return Feed(self.setup.spec, self.setup.model)

    def _give_up(self, known: Begun | None, settings: str, chunks: int = 0) -> None:
        """A run that was cut off ends here when another one begins, by ``settings`` and with
        sample ``chunks``."""
        left = self.ledger.unfinished
        if left is None or known is left:
            return
        found = self.ledger.store.restore(Saved(_Come(-1, 0)), left.number)
        task, elapsed = (-1, 0) if found is None else found.state.twin
        evidence = {
            "tasks": task + 1, "elapsed": elapsed, "rows": 0, "digest": "", "given_up": True,
        }  # fmt: skip
        if "first_chunk" in left.evidence:
            evidence["chunks"] = (chunks or self.ledger.store.chunks + 1) - 1
        said = f"run {left.number} was cut off and is given up: other rows were run"
        if left.evidence.get("settings") != settings:
            said = f"run {left.number} ends: the twin file says otherwise from here on"
        event = Event(self.ledger.row, 0, "ran", "", said, evidence)
        self.ledger.commit(Batch([event], run=left.number))
        log.warning("%s", said)

    def _begun(
        self, known: Begun | None, evidence: dict[str, Any], feed: object = ()
    ) -> tuple[TwinState, Checkpoint | None]:
        """The state that the run goes on from, and the checkpoint that it is of."""
        ledger = self.ledger
        told: dict[str, Any] = {"champion": ledger.champion, "pinned": ledger.pinned}
        told |= {} if known is None else known.evidence
        self.driver = Driver(
            self.setup, ledger.versions, self.tell, self._watch, told["champion"], told["pinned"],
            engine=self.engine, live=self.live,
        )  # fmt: skip
        found = None if known is None else self._restored(known, feed)
        if known is not None and found is None and known.evidence.get("handed_on"):
            # what it began with is lost, so it cannot be repeated
            if not known.over:
                self._give_up(None, evidence["settings"])
                return self._begun(None, evidence, feed)
            self._retell(known)
            return self.driver.init(), None
        state: TwinState = self.driver.init() if found is None else found.state.twin
        if known is None:
            state = self._taken_up(state, evidence)
            evidence = evidence | ({"handed_on": True} if self._handed else {})
            self.log = RunLog.begin(ledger, evidence, self._prints)
        else:
            self.log = RunLog.again(ledger, known, found, self._prints)
        self.driver.outside = self.log
        if known is not None and found is not None:
            self.observer.restore(self._said(known, found.length), found.shown)
            log.info("run %d goes on from row %d", known.number, found.row)
        self.observer.trace.remembers = self._lasting
        self._kept = self._from = ledger.at = state.row
        return state, found

    def _retell(self, known: Begun) -> None:
        """What a run said is shown, and its rows as the versions predict them that were live."""
        self._lost, self.driver.pinned = True, True  # nothing is decided
        self.driver.log = lambda row, records: None
        self.driver.outside = Retold.of(self.ledger.store, known)
        self.observer.restore(self._said(known, known.last), {})
        self.log = RunLog(self.ledger, known, (), self._prints)

    def _taken_up(self, state: TwinState, evidence: dict[str, Any]) -> TwinState:
        """What the run before hands on; kept with the first rows: its own checkpoints go then."""
        last = self.ledger.runs[-1] if self.ledger.runs else None
        if self.pushed or not self._lasting or last is None or last.ended is None:
            return state
        same = last.evidence.get("settings") == evidence["settings"]
        if last.ended["given_up"] or not same or self.anew:
            return state
        found = carried(self.driver, self.ledger.store, last.number, state)
        if found is None:
            return state
        self._handed = True
        return found

    def _restored(self, known: Begun, feed: object) -> Checkpoint | None:
        """The newest checkpoint of a run; None: it has to be folded from its first row."""
        try:
            return self.driver.restored(self.ledger.store, known.number, feed)
        except StoreError as error:
            log.warning("run %d is folded from its first row: %s", known.number, error)
            return None

    def _said(self, known: Begun, length: int) -> Iterator[Record]:
        """What a run said up to a position in the log."""
        store = self.ledger.store
        for entry in store.entries(known.position, ("event", "answer")):
            if entry.run == known.number and entry.number <= length:
                record = store.record(entry)
                if isinstance(record, Answer) or (
                    isinstance(record, Event) and record.kind != "ran"
                ):
                    yield record

    def step(self, state: TwinState, block: Block) -> TwinState:
        """Further rows."""
        if self._lasting and not self.pushed:
            self._prints.begin(block)
        if self._handed:
            self.log.say(state.row, (), self._of(copy(Saved(state))))
            self._handed = False
        self.log.begins(state.row)
        for part in rest([block], state.row):
            state = self.driver.step(state, part)
        return state

    def tell(self, row: int, records: Sequence[Record]) -> None:
        """What became known before ``row``: into the log, as one decision."""
        self.log.say(row, records)
        for record in records:
            self.observer.record(record)
            if isinstance(record, Event):
                log.info("row %d: %s %s: %s", row, record.kind, record.signal, record.reason)

    def _watch(self, state: TwinState, piece: Block, out: Followed) -> None:
        """After each piece: what is shown of it; a checkpoint where one is due."""
        self.observer.watch(state, piece, out)
        self.ledger.at = state.row
        if not self.pushed:
            self.save(state)

    def save(
        self, state: TwinState, feed: object = (), *, due: bool = False, chunks: int = -1
    ) -> None:
        """A checkpoint, where one is ``due``; of a run of pushed samples with what it needs beside
        it, and the number of the newest that was folded."""
        if not self._lasting or self.log.repeats or self.log.run.over:
            return
        now = time.perf_counter()
        passed = state.row - self._kept >= self.every if self.every else now >= self._due
        if due or passed:
            self.log.say(state.row, (), self._of(copy(Saved(state, feed)), chunks))
            took = time.perf_counter() - now
            self._kept, self._due = state.row, now + max(SECONDS, SHARE * took)

    def _of(self, saved: Saved, chunks: int = -1) -> Checkpoint:
        shown, run = self.observer.trace.fresh(), self.log.run.number
        return Checkpoint(saved.twin.row, saved, run, chunks=chunks, shown=shown)

    def _finished(self, state: TwinState) -> TwinState:
        """The end of the data, and of the run."""
        if state.row == 0:
            return state
        state = self.driver.finish(state)
        if self._lost:
            pinned = self.log.run.evidence["pinned"]
            return state._replace(agenda=state.agenda._replace(pinned=pinned))
        evidence: dict[str, Any] = {
            "tasks": state.task + 1, "elapsed": state.elapsed, "rows": state.row,
            "digest": self._prints.at(state.row), "given_up": False,
        }  # fmt: skip
        chunks = self.ledger.store.chunks if self.pushed else 0
        evidence |= {"chunks": chunks} if chunks else {}
        ran = Event(state.row, state.time, "ran", "", f"{state.task + 1} tasks", evidence)
        kept = self._lasting and not self.pushed and not self.log.run.over
        self.log.say(state.row, [ran], self._of(Saved(state)) if kept else None)
        return state
