"""One run from the first row to the last: blocks into the driver, records into the ledger.

>>> Run.__name__
'Run'
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from evertwin.errors import UsageError
from evertwin.fold import Block, Event, Record, take
from evertwin.loop.driver import Driver
from evertwin.loop.feed import Data, Feed
from evertwin.loop.ledger import Ledger
from evertwin.loop.observer import Observer
from evertwin.loop.rate import measured
from evertwin.loop.result import RunResult
from evertwin.loop.setup import Setup
from evertwin.loop.twin_state import TwinState
from evertwin.loop.versions import Versions
from evertwin.store import Store

__all__ = ["Run"]

log = logging.getLogger("evertwin")


@dataclass(frozen=True)
class Run:
    """What a run works with. See the module."""

    setup: Setup
    versions: Versions
    ledger: Ledger
    store: Store

    def run(self, data: Data, observer: Observer, every: int, *, again: bool) -> RunResult:
        """Plays ``data``; ``again``: from the newest checkpoint on.

        Raises:
            DataError: a recording cannot be read.
            UsageError: ``again``, and the store holds no checkpoint.
        """
        began = time.perf_counter()
        feed = Feed(self.setup.spec, self.setup.model)
        rate, blocks = measured(feed.stream(data))
        driver = Driver(
            self.setup.at(rate), self.versions, self._keep(observer), observer.watch,
            self.ledger.champion, self.ledger.pinned,
        )  # fmt: skip
        state = self._restored(driver) if again else driver.init()
        kept = state.row
        self.ledger.begin(state.row, state.time)
        for block in blocks:
            part = block if block.row >= state.row else _rest(block, state.row)
            state = driver.step(state, part) if len(part.t) else state
            if every and state.row - kept >= every:
                kept = state.row
                self.store.checkpoint(state, kept)
        state = driver.finish(state)
        self.ledger.keep_versions()
        self.ledger.end(state.row, state.time, state.task + 1, state.elapsed)
        self.store.checkpoint(state, state.row)
        seconds = time.perf_counter() - began
        result = observer.result(driver, state, seconds)
        log.info("%s: %d rows in %.2f s", self.setup.spec.name, state.row, seconds)
        return replace(result, left_out=feed.left_out)

    def _restored(self, driver: Driver) -> TwinState:
        state = driver.restored(self.store)
        if state is None:
            raise UsageError("resume: the store holds no checkpoint: start with run")
        self.ledger.switch(state.live.version, "resumed", f"from the checkpoint at row {state.row}")
        return state

    def _keep(self, observer: Observer) -> Callable[[int, Record], None]:
        def keep(row: int, record: Record) -> None:
            self.ledger.add(record, row)
            observer.record(record)
            if isinstance(record, Event):
                log.info("row %d: %s %s: %s", row, record.kind, record.signal, record.reason)

        return keep


def _rest(block: Block, row: int) -> Block:
    """The rows of a block from number ``row`` on; none where it ends before."""
    n = len(block.t)
    return take(block, min(row - block.row, n), n)
