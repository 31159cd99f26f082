"""A store in any SQL database: what the contract asks for, once, whichever database keeps it.

A database is what `Sql` says: a file of SQLite (`evertwin.store.sql.database`), or what one twin
has of a PostgreSQL server (`evertwin.store.postgres.database`). Its tables have the same names and
columns, so the statements are the same.

>>> from evertwin.store.sql.database import Database
>>> from evertwin.fold import Event
>>> store = SqlStore(Database(":memory:"))
>>> tuned = Event(row=7, time=70, kind="tuned", signal="Fc", reason="torque off by 9 %")
>>> store.commit(Batch([tuned])).length
1
>>> [event.kind for event in store.read("event", 0, 10)], store.verify()
(['tuned'], 1)
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from evertwin.errors import StoreDamaged, StoreError
from evertwin.files import make_whole
from evertwin.fold import Chunk, Event
from evertwin.store.chain import SEED, Entry, Head, chained, link
from evertwin.store.contract import Batch, Checkpoint, Progress
from evertwin.store.kinds import KINDS, Kept, decode, encode, kind_of, loads, row_of
from evertwin.store.sql.arrays import unpack
from evertwin.store.sql.checkpoints import Checkpoints
from evertwin.store.sql.database import Sql
from evertwin.store.sql.pieces import name_of, proof
from evertwin.store.sql.soundness import as_printed, found_head, look, verify
from evertwin.store.sql.tables import Fence, Job, Tables
from evertwin.store.sql.writer import Writer

S = TypeVar("S")
LINKED = (
    "SELECT l.number, l.run, l.kind, l.row, l.content, l.hash, p.hash FROM log l "
    "LEFT JOIN log p ON p.number = l.number - 1 WHERE "
)
CHUNK = "SELECT number, source, task, start, stop, content, hash FROM samples WHERE "
ALL = 2**63 - 1


class SqlStore:
    """A store in a database (`Store` says what each method does).

    >>> from evertwin.store.sql.database import Database
    >>> store = SqlStore(Database(":memory:"))
    >>> store.restore((0.0,)) is None
    True
    >>> _ = store.commit(Batch(checkpoint=Checkpoint(10, (1.5,))))
    >>> store.restore((0.0,)).state
    (1.5,)
    """

    def __init__(
        self, database: Sql, *, threaded: bool = False, read_only: bool = False,
        fence: Fence | None = None,
    ) -> None:  # fmt: skip
        """Takes what the database holds, once it was looked at.

        Args:
            database: that of this store alone; closed with it.
            threaded: writes on a thread of its own, all that waits in one transaction.
            read_only: look while another process may be writing.
            fence: what every transaction is held against: one under an old token is refused.

        Raises:
            StoreDamaged: it does not match its hashes.
        """
        self._open = True
        self._read_only = read_only
        self.path = database.path
        self._on(database, threaded, fence)

    def _on(self, database: Sql, threaded: bool, fence: Fence | None = None) -> None:
        self._db = database
        try:
            self._checkpoints = Checkpoints(database)
            self._tables = Tables(database, self._checkpoints, fence)
            self._writer = Writer(self._tables, threaded=threaded)
            self._came = self._tables.samples
            self._head, verified = found_head(database)
            if not self._read_only:
                self._tables.verified = look(database, verified)
        except StoreError:
            database.close()
            raise

    # ------------------------------------------------------------------ writing

    @property
    def head(self) -> Head:
        """Where the log ends."""
        return found_head(self._db)[0] if self._read_only else self._head

    def commit(self, batch: Batch, *, wait: bool = True) -> Head:
        """Takes a batch, after those before it; the head of the log with it."""
        self._check_open()
        if self._read_only:
            raise StoreError(f"{self.path}: opened read only")
        entries = self._linked(batch)
        size = sum(len(entry.content) for entry in entries)
        size += sum(chunk.t.nbytes + chunk.v.nbytes for chunk in batch.chunks)
        with self._marked():
            self._writer.put(Job(entries, batch), size)
            self._came += len(batch.chunks)
            if entries:
                self._head = Head(entries[-1].number, entries[-1].hash)
            if wait:
                self._writer.flush()
        return self._head

    def _linked(self, batch: Batch) -> tuple[Entry, ...]:
        """The batch's records as entries behind the head."""
        entries, at = [], self._head
        for record in batch.records:
            told = (batch.run, kind_of(record), row_of(record, batch.row), encode(record))
            number = at.length + 1
            entries.append(Entry(number, *told, link(at.hash, number, *told)))
            at = Head(number, entries[-1].hash)
        return tuple(entries)

    def flush(self) -> None:
        """Returns when everything is durable."""
        self._writer.flush()

    def ask(self, events: Sequence[Event]) -> None:
        """Asks the process that works with the store, where this one only reads it."""
        self._check_open()
        told = [encode(event) for event in events]
        database = self._db.again()
        try:
            with database.transaction() as db:
                db.executemany("INSERT INTO inbox (content, hash) VALUES (?, ?)",
                               [(content, proof(content)) for content in told])  # fmt: skip
        finally:
            database.close()

    def asked(self) -> tuple[tuple[Event, ...], int]:
        """What other processes have asked for and no batch has heard, and its last number."""
        self._check_open()
        found = self._db.query("SELECT number, content, hash FROM inbox ORDER BY number")
        sound = [content for _, content, digest in found if proof(content) == digest]
        events = [decode("event", loads(content)) for content in sound]
        return tuple(e for e in events if isinstance(e, Event)), found[-1][0] if found else 0

    # ------------------------------------------------------------------ reading

    def read(self, kind: str, start: int = 0, stop: int | None = None) -> tuple[Kept, ...]:
        """Records of one kind whose row is in [start, stop), in the order of the log."""
        if kind not in KINDS:
            raise StoreError(f"expected one of {', '.join(KINDS)}, got {kind!r}")
        end = ALL if stop is None else stop
        where = "l.kind = ? AND l.row >= ? AND l.row < ? ORDER BY l.number"
        found = self._entries(where, (kind, start, end))
        return tuple(self.record(entry) for entry in found)

    def entries(
        self, after: int = 0, kinds: Sequence[str] = (), most: int = -1
    ) -> tuple[Entry, ...]:
        """Entries of the log behind a position, in order; of some kinds, or all."""
        chosen = f" AND l.kind IN ({', '.join('?' * len(kinds))})" if kinds else ""
        where = f"l.number > ?{chosen} ORDER BY l.number LIMIT ?"
        return self._entries(where, (after, *kinds, ALL if most < 0 else most))

    def _entries(self, where: str, values: Sequence[Any]) -> tuple[Entry, ...]:
        """Entries, each checked against its hash and the one before."""
        found = []
        with self._marked():
            for *fields, before in self._query(LINKED + where, values):
                entry = Entry(*fields)
                known = SEED if entry.number == 1 else before or ""
                found.append(entry)
                chained([entry], Head(entry.number - 1, known))
        return tuple(found)

    def record(self, entry: Entry) -> Kept:
        """The record that an entry holds."""
        try:
            return decode(entry.kind, loads(entry.content))
        except ValueError as error:
            raise StoreDamaged(f"{self.path}: entry {entry.number} is no JSON text") from error

    @property
    def chunks(self) -> int:
        """Number of the newest samples, also if they are no longer kept; 0: there were none."""
        return self._db.samples() if self._read_only else self._came

    def read_chunks(self, start: int = 1, stop: int | None = None) -> Iterator[tuple[int, Chunk]]:
        """Samples by number (from 1, in order of arrival), those in [start, stop) that are kept."""
        end = ALL if stop is None else stop
        return self._chunks("number < ?", (end,), start)

    def samples(self, source: str, first: int, last: int) -> Iterator[Chunk]:
        """What is kept of a source with stamps in [first, last] [ns], in order of arrival."""
        where = "source = ? AND stop >= ? AND start <= ?"
        for _, chunk in self._chunks(where, (source, first, last)):
            wanted = (chunk.t >= first) & (chunk.t <= last)
            if wanted.any():
                yield chunk._replace(t=chunk.t[wanted], v=chunk.v[wanted])

    def newest(self, source: str) -> tuple[int, int] | None:
        """Task and stamp [ns] of the newest sample of a source; None: it has none."""
        query = "SELECT task, max(stop) FROM samples WHERE source = ? GROUP BY task"
        found = self._query(f"{query} ORDER BY task DESC LIMIT 1", (source,))
        return None if not found else (int(found[0][0]), int(found[0][1]))

    def _chunks(
        self, where: str, values: Sequence[Any], start: int = 1
    ) -> Iterator[tuple[int, Chunk]]:
        """Samples from a number on, each checked against its hash."""
        query = f"{CHUNK}{where} AND number >= ? ORDER BY number LIMIT 100"
        while found := self._query(query, (*values, start)):
            for number, source, task, first, last, content, digest in found:
                if proof(source, task, first, last, name_of(content)) != digest:
                    raise StoreDamaged(f"{self.path}: sample {number} does not match its hash")
                arrays = unpack(content)
                clock = tuple(arrays["clock"].tolist()) if "clock" in arrays else None
                yield number, Chunk(source, arrays["t"], arrays["v"], task, clock)
            start = found[-1][0] + 1

    def restore(
        self, like: S, run: int | None = None, before: int | None = None
    ) -> Checkpoint | None:
        """The newest sound checkpoint (of a run, before a row) in the shape of ``like``."""
        self.flush()
        self._check_open()
        return self._checkpoints.restore(like, run, before)

    def progress(self) -> Progress | None:
        """How far the newest run has come; None: not known."""
        found = self._query("SELECT run, rows, digest, hash FROM progress")
        sound = found and proof(*found[0][:3]) == found[0][3]
        return Progress(*found[0][:3]) if sound else None

    def verify(self, head: Head | None = None) -> int:
        """Number of entries, all of which match the chain; names the first that does not."""
        self.flush()
        self._check_open()
        with self._marked():
            found, there = verify(self._db, 0 if head is None else head.length)
            for _ in self.read_chunks():
                pass
            self._checkpoints.verify()
        if head is not None:
            as_printed(head, found, there)
        return found.length

    def recover(self) -> Event:
        """Nothing to start anew from: a server's damage is its administrator's.

        Raises:
            StoreError: always.
        """
        raise StoreError(f"{self.path}: damaged: restore it from a backup")

    def backup(self, path: Path) -> None:
        """A copy of everything that is durable, whole or not at all, while work goes on."""
        self.flush()
        self._check_open()
        make_whole(path, self._db.copy_to)

    def close(self) -> None:
        """Makes all durable and releases the store; a second call does nothing."""
        if self._open:
            self._open = False
            try:
                self._writer.close()
                self._db.close()
            finally:
                self._release()
            self._writer.check()

    def __del__(self) -> None:
        """Who forgot to close it leaves neither a lock nor a thread."""
        if not sys.is_finalizing() and hasattr(self, "_writer"):
            self.close()

    def _release(self) -> None:
        """Lets go of what keeps others out."""

    def _query(self, text: str, values: Sequence[Any] = ()) -> list[Any]:
        self._check_open()
        with self._marked():
            self.flush()
            return self._db.query(text, values)

    @contextmanager
    def _marked(self) -> Iterator[None]:
        """Around what may find damage."""
        yield

    def _check_open(self) -> None:
        if not self._open:
            raise StoreError(f"{self.path}: the store is closed")
