"""One run from the first row to the last: blocks into the driver, records into the book.

>>> Play.__name__
'Play'
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from evertwin.errors import UsageError
from evertwin.fold import Block, Event, Record, take
from evertwin.store import Store
from evertwin.twin.book import Book
from evertwin.twin.driver import Driver
from evertwin.twin.feed import Data, Feed
from evertwin.twin.observer import Observer
from evertwin.twin.result import RunResult
from evertwin.twin.setup import Setup
from evertwin.twin.state import TwinState
from evertwin.twin.versions import Versions

__all__ = ["Play"]

log = logging.getLogger("evertwin")


@dataclass(frozen=True)
class Play:
    """What a run works with. See the module."""

    setup: Setup
    versions: Versions
    book: Book
    store: Store

    def run(self, data: Data, observer: Observer, every: int, *, again: bool) -> RunResult:
        """Plays ``data``; ``again``: from the newest checkpoint on.

        Raises:
            DataError: a recording cannot be read.
            UsageError: ``again``, and the store holds no checkpoint.
        """
        began = time.perf_counter()
        feed = Feed(self.setup.spec, self.setup.model)
        driver = Driver(
            self.setup, self.versions, self._keep(observer), observer.watch, self.book.champion,
            self.book.pinned,
        )  # fmt: skip
        state = self._restored(driver) if again else driver.init()
        kept = state.row
        self.book.begin(state.row, state.time)
        for block in feed.stream(data):
            part = block if block.row >= state.row else _rest(block, state.row)
            state = driver.step(state, part) if len(part.t) else state
            if every and state.row - kept >= every:
                kept = state.row
                self.store.checkpoint(state, kept)
        state = driver.finish(state)
        self.book.keep_versions()
        self.book.end(state.row, state.time, state.task + 1, state.elapsed)
        self.store.checkpoint(state, state.row)
        seconds = time.perf_counter() - began
        result = observer.result(driver, state, seconds)
        log.info("%s: %d rows in %.2f s", self.setup.spec.name, state.row, seconds)
        return replace(result, problems=dict(feed.tally.counts))

    def _restored(self, driver: Driver) -> TwinState:
        state = driver.restored(self.store)
        if state is None:
            raise UsageError("resume: the store holds no checkpoint: start with run")
        self.book.switch(state.live.version, "resumed", f"from the checkpoint at row {state.row}")
        return state

    def _keep(self, observer: Observer) -> Callable[[int, Record], None]:
        def keep(row: int, record: Record) -> None:
            self.book.add(record, row)
            observer.record(record)
            if isinstance(record, Event):
                log.info("row %d: %s %s: %s", row, record.kind, record.signal, record.reason)

        return keep


def _rest(block: Block, row: int) -> Block:
    """The rows of a block from number ``row`` on; none where it ends before."""
    n = len(block.t)
    return take(block, min(row - block.row, n), n)
