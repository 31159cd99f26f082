"""The store as one SQLite file: one transaction a batch, or several batches where more wait.

One table ``log`` holds every record in order, chained by hashes; the views ``events``,
``requests``, ``answers``, ``versions`` and ``estimates`` show each kind as columns to any SQLite
tool. States are kept in pieces (`evertwin.store.sql.pieces`). Nothing is ever unpickled.

>>> store = SqliteStore(":memory:")
>>> store.head.length, store.verify()
(0, 0)
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from evertwin.errors import NoStore, StoreDamaged, StoreError
from evertwin.fold import Chunk, Event
from evertwin.store.chain import Head
from evertwin.store.sql.database import MEMORY, Database, Foreign
from evertwin.store.sql.store import SqlStore
from evertwin.store.sql.tables import OLD
from evertwin.store.sqlite.archive import DAY, Archive, day_of, edges
from evertwin.store.sqlite.archive import KIND as ARCHIVED
from evertwin.store.sqlite.lock import Lock
from evertwin.store.sqlite.pages import check_log
from evertwin.store.sqlite.salvage import finish, mark_of, rebuild

log = logging.getLogger("evertwin")


class SqliteStore(SqlStore):
    """A store in one file, or in memory (`Store` says what each method does).

    >>> from evertwin.store import Batch, Checkpoint
    >>> store = SqliteStore(":memory:")
    >>> _ = store.commit(Batch(checkpoint=Checkpoint(10, (1.5,))))
    >>> store.restore((0.0,)).state
    (1.5,)
    """

    def __init__(self, path: str | Path, *, read_only: bool = False) -> None:
        """Open or create.

        Args:
            path: a file, or ``":memory:"``.
            read_only: look while another process may be writing; takes no lock.

        Raises:
            StoreLocked: another process has it.
            StoreDamaged: it does not match its hashes.
            StoreError: it is no store, or was written by a newer evertwin.
        """
        self.path = str(path)
        self._read_only = read_only
        self._open = True
        stored = self.path != MEMORY
        self.archive = Archive(self.path, self._archived)
        if read_only and not Path(path).is_file():
            raise NoStore(f"{path}: no such store")
        self._lock = Lock(Path(path)) if stored and not read_only else None
        self.recovered: Event | None = None
        """What was lost, where the file was damaged when it was opened."""
        try:
            self._begin()
        except (StoreDamaged, Foreign) as error:
            if self._lock is None:
                raise
            self._recover(error)
        except StoreError:
            self._release()
            raise

    def _begin(self) -> None:
        """Opens the file, and looks whether it is sound."""
        if self._lock is not None:
            path = Path(self.path)
            finish(path)
            check_log(path)
            ahead = Path(f"{path}-wal")
            if path.exists() and not any(p.stat().st_size for p in (path, ahead) if p.exists()):
                raise StoreDamaged(f"{path}: a file of no bytes")
            if mark_of(path).exists():
                raise StoreDamaged(f"{path}: damage was found in it before")
        self._on(Database(self.path, read_only=self._read_only), self._lock is not None)

    def _recover(self, error: StoreError) -> None:
        """Goes on with what is sound."""
        try:
            self.recovered = rebuild(Path(self.path), error)
            self._begin()
        except StoreError:
            self._release()
            raise
        log.warning("%s: %s", self.path, self.recovered.reason)

    def recover(self) -> Event:
        """Starts anew from what is sound, where `verify` or a reader found damage; what was lost.

        Raises:
            StoreError: in memory, or read only.
        """
        if self._lock is None:
            raise StoreError(f"{self.path}: in memory or opened read only")
        self._writer.close()
        self._db.close()
        self._recover(StoreDamaged("repaired on demand"))
        assert self.recovered is not None
        return self.recovered

    def ask(self, events: Sequence[Event]) -> None:
        """Asks the process that works with the store, where this one only reads it."""
        if self.path == MEMORY:
            raise StoreError("a store in memory belongs to its process alone")
        super().ask(events)

    def samples(self, source: str, first: int, last: int) -> Iterator[Chunk]:
        """What is kept of a source with stamps in [first, last] [ns], in order of arrival."""
        yield from self.archive.samples(source, first, last)
        yield from super().samples(source, first, last)

    def _archived(self, after: int) -> list[tuple[int, Event]]:
        """The events behind a position that name files."""
        where = f"l.number > ? AND l.kind = 'event' AND l.content LIKE '%\"{ARCHIVED}\"%' "
        found = self._entries(f"{where}ORDER BY l.number", (after,))
        told = ((entry.number, self.record(entry)) for entry in found)
        return [(n, e) for n, e in told if isinstance(e, Event) and e.kind == ARCHIVED]

    def whole(self, source: str, before: int) -> Iterator[str]:
        """Days of a source that ended before a stamp [ns] and no checkpoint needs, oldest first."""
        old = f"source = ? AND stop >= 0 AND stop < ? AND {OLD}"
        query = f"SELECT DISTINCT stop / {DAY} FROM samples WHERE {old} ORDER BY 1"
        found = self._query(query, (source, before // DAY * DAY))
        return (day_of(number * DAY) for (number,) in found)

    def of_day(self, source: str, day: str) -> Iterator[tuple[int, Chunk]]:
        """The pieces of a source that ended on a day and no checkpoint needs, by number."""
        where = f"source = ? AND stop >= ? AND stop < ? AND {OLD}"
        return self._chunks(where, (source, *edges(day)))

    def verify(self, head: Head | None = None) -> int:
        """Number of entries, all of which match the chain; names the first that does not."""
        found = super().verify(head)
        with self._marked():
            self.archive.verify()
        return found

    def backup(self, path: Path) -> None:
        """A copy of everything that is durable, whole or not at all, while work goes on."""
        super().backup(path)
        self.archive.copy_to(path)

    def _release(self) -> None:
        if self._lock is not None:
            self._lock.release()

    @contextmanager
    def _marked(self) -> Iterator[None]:
        """Damage that is found here is repaired by whoever opens the store next."""
        try:
            yield
        except StoreDamaged:
            if self._lock is not None:
                mark_of(Path(self.path)).touch()
            raise
