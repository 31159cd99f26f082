"""What a run says, and the log: each record stands there once, however often the run is repeated.

After a crash the fold goes on from a checkpoint and says again what it had said since. The log has
it already: each record is compared with the entry at its place, and passed over. What slow work had
answered is taken from the log. What was said from outside meanwhile (promote, roll back, pin,
label) is heeded where it stands: at the first beat from its row on, after everything before it was
said. A label from between two runs is heeded by the later one, at its first beat.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

from evertwin.errors import StoreError
from evertwin.fold import Answer, Event, Record, Request
from evertwin.ledger.begun import Begun
from evertwin.ledger.fingerprint import Followed as Prints
from evertwin.ledger.ledger import Ledger
from evertwin.models.form import Version
from evertwin.store import Batch, Checkpoint, Entry, Kept, Progress
from evertwin.store.kinds import encode, kind_of, row_of

HEEDED = ("promoted", "rolled_back", "pinned", "labelled")
SECONDS = 0.2
"""Time from one look at what other processes ask for to the next."""


class RunLog:
    """The log of one run, at the place that its fold has come to.

    >>> from evertwin.ledger.versions import Versions
    >>> from evertwin.models import FunctionModel, Parameters
    >>> from evertwin.signals import Layout
    >>> from evertwin.store import SqliteStore
    >>> model = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(u="1"),
    ...     Layout.of(y="1"), Layout(), Parameters.of(gain=(1.0, "1")))
    >>> ledger = Ledger(SqliteStore(":memory:"), Versions(model), "cart")
    >>> log = RunLog.begin(ledger, {"settings": ""}, Prints())
    >>> log.say(0, [Event(5, 50, "drift", "x", "mean innovation 3 σ")])
    >>> [event.kind for event in ledger.store.read("event")]
    ['configured', 'started', 'drift']
    """

    def __init__(
        self, ledger: Ledger, run: Begun, tail: Sequence[Entry], prints: Prints,
        labels: Sequence[Event] = (),
    ) -> None:  # fmt: skip
        """Repeats a run: ``tail`` is the log behind the fold's place, ``labels`` what was said
        before the run and is not heeded yet."""
        self.ledger = ledger
        self.run = run
        self.orders: deque[Event] = deque(labels)
        """Said from outside, not yet heeded."""
        self._tail = deque(tail)
        self._prints = prints
        self._begins = False
        self._listens = 0.0
        self._ahead = deque(e.row for e in tail if self._order(e) is not None)
        """Rows of orders that the tail has."""
        self._outside()

    @classmethod
    def begin(cls, ledger: Ledger, evidence: dict[str, Any], prints: Prints) -> RunLog:
        """A new run; the log tells of it with the first that it says."""
        number = 1 + max((run.number for run in ledger.runs), default=0)
        tasks, elapsed = ledger.counts(number)
        known = {
            "champion": ledger.champion, "versions": len(ledger.versions), "pinned": ledger.pinned,
            "tasks_before": tasks, "elapsed_before": elapsed, **evidence,
        }  # fmt: skip
        ledger.orders.clear()  # the run begins with what they say
        run = Begun(number, ledger.store.head.length + 1, known)
        log = cls(ledger, run, (), prints, ledger.labels(run, 0))
        log._begins = True
        return log

    @classmethod
    def again(cls, ledger: Ledger, run: Begun, after: Checkpoint | None, prints: Prints) -> RunLog:
        """A run that the log knows, from a checkpoint of it or from its beginning."""
        position = run.position - 1 if after is None else after.length
        entries = ledger.store.entries(position)
        last = max((e.number for e in entries if e.run == run.number), default=position)
        tail = [e for e in entries if e.run == run.number or (e.run == 0 and e.number <= last)]
        if not run.over:
            tail = [e for e in entries if e.run in (0, run.number)]
        known = run.evidence["versions"] if after is None else _versions(ledger, position)
        ledger.versions.rewind(known)
        ledger.kept = known
        ledger.orders.clear()
        log = cls(ledger, run, tail, prints, ledger.labels(run, position))
        log._begins = after is None
        return log

    @property
    def repeats(self) -> bool:
        """Does the log know already what comes next, or wait orders to be heeded?"""
        return bool(self._tail or self.orders or self.ledger.orders)

    def begins(self, row: int) -> None:
        """The run is in the log before anything is said to it."""
        if self._begins:
            self.say(row, ())

    def say(
        self, row: int, records: Sequence[Record], checkpoint: Checkpoint | None = None
    ) -> None:
        """What became known before ``row``, as one decision, with the state after it.

        Raises:
            StoreError: the log has something else at this place.
        """
        said: list[Kept] = [self._started()] if self._begins else []
        self._begins = False
        said += self.ledger.batch(records, row, self.run.number)
        fresh = [record for record in said if not self._known(record, row)]
        if fresh and self.run.over:
            raise self._differs("nothing more", fresh[0], row)
        if fresh or checkpoint is not None:
            done = Progress(self.run.number, row, self._prints.at(row))
            batch = Batch(fresh, row, self.run.number, (), checkpoint, done)
            # a request is stored before its work begins
            self.ledger.commit(batch, wait=any(isinstance(r, Request) for r in fresh))

    def answer(self, number: int) -> tuple[int, Answer] | None:
        """The row and the answer to a request where the log has it."""
        for entry in self._tail:
            if entry.kind == "answer":
                answer = self.ledger.store.record(entry)
                if isinstance(answer, Answer) and answer.id == number:
                    return entry.row, answer
        return None

    def knows_more(self) -> bool:
        """Does the log have more of this run than was said again?"""
        return bool(self._tail)

    def next_order(self) -> float:
        """Row from which on the next order is in force; infinite: there is none."""
        self._hear()
        rows = [order.row for order in (*self.orders, *self.ledger.orders)]
        return min([*rows, *self._ahead], default=math.inf)

    def heed(self, row: int) -> tuple[Event, ...]:
        """What was said from outside and is in force from a beat at ``row`` on."""
        self._hear()
        self.orders += self.ledger.orders
        self.ledger.orders.clear()
        found = []
        while self.orders and self.orders[0].row <= row:
            found.append(self.orders.popleft())
        return tuple(found)

    def end(self) -> None:
        """Leaves versions as the whole log has them, and all of it durable."""
        self.ledger.kept = len(self.ledger.versions)
        self.ledger.versions.rewind(self.ledger.kept)
        self.ledger.store.flush()

    def _started(self) -> Event:
        told = {"first": self._prints.first, **self.run.evidence}
        return Event(0, 0, "started", "", f"run {self.run.number}", told)

    def _known(self, record: Kept, row: int) -> bool:
        """Has the log this record at this place?"""
        if not self._tail:
            return False
        entry = self._tail.popleft()
        if (kind_of(record), row_of(record, row), encode(record)) != entry[2:5]:
            raise self._differs(f"{entry.kind} of row {entry.row}: {entry.content}", record, row)
        self.ledger.kept += isinstance(record, Version)
        self._outside()
        return True

    def _hear(self) -> None:
        """What other processes ask for, now and then."""
        now = time.monotonic()
        if not self._tail and now >= self._listens:
            self._listens = now + SECONDS
            self.ledger.hear()

    def _order(self, entry: Entry) -> Event | None:
        """The order that an entry is; None: something else."""
        if entry.run == self.run.number or entry.kind != "event":
            return None
        record = self.ledger.store.record(entry)
        return record if isinstance(record, Event) and record.kind in HEEDED else None

    def _outside(self) -> None:
        """Passes what was said from outside of the run."""
        ledger = self.ledger
        while self._tail and self._tail[0].run != self.run.number:
            entry = self._tail.popleft()
            if entry.kind == "version":
                ledger.kept += 1
                ledger.versions.rewind(ledger.kept)
            elif (order := self._order(entry)) is not None:
                self.orders.append(order)
                self._ahead.popleft()

    def _differs(self, expected: str, record: Kept, row: int) -> StoreError:
        got = f"{kind_of(record)} of row {row_of(record, row)}: {encode(record)}"
        return StoreError(
            f"run {self.run.number} is repeated, and the log has {expected[:300]}\nwhere the same "
            f"rows now give {got[:300]}\nAnother version of evertwin, of a library or of the "
            "model? --again (again=True) runs the rows once more as a run of its own"
        )


def _versions(ledger: Ledger, position: int) -> int:
    """Versions in the log up to a position."""
    later = ledger.store.entries(position, ["version"])
    return len(ledger.versions) - len(later)
