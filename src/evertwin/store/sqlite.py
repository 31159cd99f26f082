"""The store as one SQLite file: write-ahead log, full synchronisation, one transaction an append.

One table ``log`` holds every record in order, chained by hashes; the views ``events``,
``requests``, ``answers``, ``versions`` and ``estimates`` show each kind as columns to any SQLite
tool. Checkpoints are NumPy archives without pickle.

>>> from evertwin.fold import Event
>>> store = SqliteStore(":memory:")
>>> store.append([Event(row=7, time=70, kind="tuned", signal="Fc", reason="torque off by 9 %")])
>>> [event.kind for event in store.read("event", 0, 10)], store.verify()
(['tuned'], 1)
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from evertwin.errors import StoreError
from evertwin.fold.state import load, save
from evertwin.store.chain import Entry, Head, link, verify
from evertwin.store.contract import Checkpoint
from evertwin.store.kinds import KINDS, Kept, decode, encode, kind_of, loads, row_of
from evertwin.store.lock import Lock

__all__ = ["SqliteStore"]

S = TypeVar("S")
MEMORY = ":memory:"
SCHEMA = 1
APPLICATION = 0x45565457  # "EVTW", in the file's header
DAMAGE = (sqlite3.DatabaseError, UnicodeDecodeError)
"""What SQLite raises where a file is damaged: a schema that is no text is not its own error."""
KEPT = 3
"""Checkpoints that stay; older ones only as entries of the log."""

TABLES = """
CREATE TABLE head (one INTEGER PRIMARY KEY CHECK (one = 1), length INTEGER, hash TEXT);
CREATE TABLE log (number INTEGER PRIMARY KEY, kind TEXT NOT NULL, row INTEGER NOT NULL,
                  content TEXT NOT NULL, hash TEXT NOT NULL);
CREATE INDEX log_kind_row ON log (kind, row);
CREATE TABLE checkpoints (number INTEGER PRIMARY KEY, row INTEGER NOT NULL, state BLOB NOT NULL);
CREATE TRIGGER log_is_final BEFORE UPDATE ON log
    BEGIN SELECT RAISE(ABORT, 'the log is append-only'); END;
CREATE TRIGGER log_is_kept BEFORE DELETE ON log
    BEGIN SELECT RAISE(ABORT, 'the log is append-only'); END;
"""
VIEWS = {
    "answer": ("id", "version", "content"),
    "estimate": ("time", "version", "name", "value", "low", "high", "verdict"),
    "event": ("time", "kind", "signal", "reason", "evidence"),
    "request": ("id", "kind", "version", "due", "window", "detail"),
    "version": ("number", "parent", "hash", "form", "names", "values", "reason"),
}


class SqliteStore:
    """A store in one file, or in memory (`Store` says what each method does).

    >>> store = SqliteStore(":memory:")
    >>> store.restore((0.0,)) is None
    True
    >>> store.checkpoint((1.5,), row=10)
    >>> store.restore((0.0,))
    Checkpoint(row=10, state=(1.5,))
    """

    def __init__(self, path: str | Path, *, read_only: bool = False) -> None:
        """Open or create.

        Args:
            path: a file, or ``":memory:"``.
            read_only: look while another process may be writing; takes no lock.

        Raises:
            StoreLocked: another process has it.
            StoreError: it is no store, is damaged, or was written by a newer evertwin.
        """
        self.path = str(path)
        self._read_only = read_only
        self._open = True
        stored = self.path != MEMORY
        if read_only and not Path(path).is_file():
            raise StoreError(f"{path}: no such store")
        self._lock = Lock(Path(path)) if stored and not read_only else None
        self._db = self._guarded(self._connect)
        try:
            self._guarded(self._prepare)
        except StoreError:
            self.close()
            raise

    def _connect(self) -> sqlite3.Connection:
        if not self._read_only:
            return sqlite3.connect(self.path, timeout=5, isolation_level=None)
        address = f"{Path(self.path).resolve().as_uri()}?mode=ro"
        return sqlite3.connect(address, timeout=5, isolation_level=None, uri=True)

    def _prepare(self) -> None:
        """Create what is missing, refuse what is foreign."""
        (version,) = self._db.execute("PRAGMA user_version").fetchone()
        (application,) = self._db.execute("PRAGMA application_id").fetchone()
        (tables,) = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if tables and application != APPLICATION:
            raise StoreError(f"{self.path}: a database of another program, expected a store")
        if version > SCHEMA:
            raise StoreError(
                f"{self.path}: written by a newer evertwin (schema {version}, this one reads up to "
                f"{SCHEMA}): upgrade evertwin"
            )
        if not self._read_only:
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = FULL")
        if not tables:
            self._create()

    def _create(self) -> None:
        with self._transaction():
            for statement in _statements(TABLES):
                self._db.execute(statement)
            for kind, columns in VIEWS.items():
                fields = ", ".join(f"json_extract(content, '$.{c}') AS \"{c}\"" for c in columns)
                self._db.execute(
                    f"CREATE VIEW {kind}s AS SELECT row, {fields} FROM log WHERE kind = '{kind}'"
                )
            self._db.execute("INSERT INTO head VALUES (1, ?, ?)", Head())
            self._db.execute(f"PRAGMA application_id = {APPLICATION}")
            self._db.execute(f"PRAGMA user_version = {SCHEMA}")

    def append(self, records: Sequence[Kept], row: int | None = None) -> None:
        """Add records to the log, in order, all or none; returns when they are durable."""
        lines = [(kind_of(item), row_of(item, row), encode(item)) for item in records]
        if not lines:
            return
        with self._writing():
            for kind, known, content in lines:
                self._add(kind, known, content)

    def _add(self, kind: str, row: int, content: str) -> None:
        before = self._head()
        number = before.length + 1
        entry = Entry(number, kind, row, content, link(before.hash, number, kind, row, content))
        self._db.execute("INSERT INTO log VALUES (?, ?, ?, ?, ?)", entry)
        self._db.execute("UPDATE head SET length = ?, hash = ?", (number, entry.hash))

    def _head(self) -> Head:
        found = self._query("SELECT length, hash FROM head", ())
        return Head(*found[0]) if found else Head()

    def read(self, kind: str, start: int = 0, stop: int | None = None) -> tuple[Kept, ...]:
        """Records of one kind whose row is in [start, stop), in the order of the log."""
        if kind not in KINDS:
            raise StoreError(f"expected one of {', '.join(KINDS)}, got {kind!r}")
        end = 2**63 - 1 if stop is None else stop
        query = "SELECT content FROM log WHERE kind = ? AND row >= ? AND row < ? ORDER BY number"
        found = self._query(query, (kind, start, end))
        return tuple(decode(kind, self._parsed(text)) for (text,) in found)

    def _parsed(self, text: str) -> Any:
        try:
            return loads(text)
        except ValueError as error:
            raise StoreError(f"{self.path}: an entry is no JSON text: verify the store") from error

    def checkpoint(self, state: Any, row: int) -> None:
        """Keep ``state`` as it is before ``row``; durable."""
        content = save(state)
        digest = hashlib.sha256(content).hexdigest()
        with self._writing():
            self._add("checkpoint", row, f'{{"hash":"{digest}","row":{row}}}')
            number = self._head().length
            self._db.execute("INSERT INTO checkpoints VALUES (?, ?, ?)", (number, row, content))
            self._db.execute(
                "DELETE FROM checkpoints WHERE number NOT IN "
                f"(SELECT number FROM checkpoints ORDER BY number DESC LIMIT {KEPT})"
            )

    def restore(self, like: S, before: int | None = None) -> Checkpoint | None:
        """The newest checkpoint (before a row), in the shape of ``like``; None if there is none."""
        query = (
            "SELECT c.row, c.state, l.content FROM checkpoints c LEFT JOIN log l "
            "ON l.number = c.number AND l.kind = 'checkpoint' "
            "WHERE c.row < ? ORDER BY c.number DESC LIMIT 1"
        )
        found = self._query(query, (2**63 - 1 if before is None else before,))
        if not found:
            return None
        row, content, entry = found[0]
        named = self._parsed(entry)["hash"] if entry else ""
        if hashlib.sha256(content).hexdigest() != named:
            raise StoreError(
                f"{self.path}: the checkpoint before row {row} does not match its hash: restore an "
                f"earlier one with before={row}, or a backup"
            )
        return Checkpoint(row, load(content, like))

    def verify(self) -> int:
        """Number of entries, all of which match the chain; names the first that does not."""
        # The chain holds the table; what is read through the index must be all of it.
        ((said, *_), *_) = self._query("PRAGMA integrity_check(1)", ())
        if said != "ok":
            raise StoreError(f"{self.path}: damaged: {said}: restore a backup")
        rows = self._query("SELECT number, kind, row, content, hash FROM log ORDER BY number", ())
        return verify((Entry(*row) for row in rows), self._head())

    def close(self) -> None:
        """Release the store; a second call does nothing."""
        if self._open:
            self._open = False
            self._db.close()
            if self._lock is not None:
                self._lock.release()

    def _query(self, text: str, values: tuple[Any, ...]) -> list[Any]:
        self._check_open()
        found: list[Any] = self._guarded(lambda: self._db.execute(text, values).fetchall())
        return found

    def _check_open(self) -> None:
        if not self._open:
            raise StoreError(f"{self.path}: the store is closed")

    @contextmanager
    def _writing(self) -> Iterator[None]:
        self._check_open()
        if self._read_only:
            raise StoreError(f"{self.path}: opened read only")
        try:
            with self._transaction():
                yield
        except DAMAGE as error:
            raise self._translated(error) from error

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._db.execute("COMMIT")
        finally:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")

    def _guarded(self, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except DAMAGE as error:
            raise self._translated(error) from error

    def _translated(self, error: Exception) -> StoreError:
        return StoreError(f"{self.path}: {error}: check the disk, or restore a backup")


def _statements(script: str) -> Iterator[str]:
    """The statements of a script; ``executescript`` would commit on its own."""
    text = ""
    for line in script.strip().splitlines():
        text += line + "\n"
        if sqlite3.complete_statement(text):
            yield text
            text = ""
