"""The SQLite file under a store: its tables, its transactions, and what is said when it is damaged.

Write-ahead log, full synchronisation: a transaction that returned is on the disk.
"""

from __future__ import annotations

import logging
import sqlite3
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from evertwin.errors import StoreDamaged, StoreError, StoreUnwritable
from evertwin.files import make_whole
from evertwin.store.chain import Head
from evertwin.store.sql.steps import upgrade

log = logging.getLogger("evertwin")
MEMORY = ":memory:"
SCHEMA = 3
SMALL = 64 << 20
"""Bytes of a file whose pages are all looked at when it is opened."""
PAGE = 4096
"""Bytes of a page of the file."""
APPLICATION = 0x45565457  # "EVTW", in the file's header

DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR)
"""What SQLite says of a damaged file; ``ERROR``: its schema lacks what every store has."""

TABLES = """
CREATE TABLE head (one INTEGER PRIMARY KEY CHECK (one = 1), length INTEGER, hash TEXT,
                   verified INTEGER);
CREATE TABLE log (number INTEGER PRIMARY KEY, run INTEGER NOT NULL, kind TEXT NOT NULL,
                  row INTEGER NOT NULL, content TEXT NOT NULL, hash TEXT NOT NULL);
CREATE INDEX log_kind_row ON log (kind, row);
CREATE TABLE checkpoints (number INTEGER PRIMARY KEY, run INTEGER NOT NULL, row INTEGER NOT NULL,
                          length INTEGER NOT NULL, chunks INTEGER NOT NULL,
                          shown INTEGER NOT NULL, layout TEXT NOT NULL, hash TEXT NOT NULL);
CREATE TABLE pieces (name TEXT PRIMARY KEY, content BLOB NOT NULL);
CREATE TABLE shown (number INTEGER PRIMARY KEY, run INTEGER NOT NULL, content BLOB NOT NULL,
                    hash TEXT NOT NULL);
CREATE TABLE progress (one INTEGER PRIMARY KEY CHECK (one = 1), run INTEGER NOT NULL,
                       rows INTEGER NOT NULL, digest TEXT NOT NULL, hash TEXT NOT NULL);
CREATE TABLE samples (number INTEGER PRIMARY KEY AUTOINCREMENT, source TEXT NOT NULL,
                      task INTEGER NOT NULL, start INTEGER NOT NULL, stop INTEGER NOT NULL,
                      content BLOB NOT NULL, hash TEXT NOT NULL);
CREATE INDEX samples_source_stop ON samples (source, stop);
CREATE TABLE inbox (number INTEGER PRIMARY KEY AUTOINCREMENT, content TEXT NOT NULL,
                    hash TEXT NOT NULL);
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


@runtime_checkable
class Writing(Protocol):
    """What a transaction is written by; a ``?`` stands for each value.

    >>> issubclass(sqlite3.Connection, Writing)
    True
    """

    def execute(self, text: str, values: Sequence[Any] = ..., /) -> Iterable[Any]:
        """One statement; its rows."""
        ...

    def executemany(self, text: str, values: Iterable[Sequence[Any]], /) -> object:
        """One statement, again and again."""
        ...


@runtime_checkable
class Sql(Protocol):
    """A database under a store: the same tables, whichever it is.

    >>> isinstance(Database(MEMORY), Sql)
    True
    """

    path: str
    """What errors call it."""
    now: str
    """Its own clock, as an expression [µs]."""
    shared: str
    """Before the name of a table that several twins share."""
    locked: str
    """What a SELECT ends with whose rows nobody may change until the transaction ends."""

    def query(self, text: str, values: Sequence[Any] = ()) -> list[Any]:
        """All rows of a question.

        Raises:
            StoreDamaged: they cannot be read.
        """
        ...

    def transaction(self) -> AbstractContextManager[Writing]:
        """What is written inside stands whole, and durable, or not at all."""
        ...

    def samples(self) -> int:
        """Number of the newest samples that were ever stored; 0: there were none."""
        ...

    def numbered(self, db: Writing, newest: int) -> None:
        """Inside a transaction, before samples are written: up to a number."""
        ...

    def alone(self, db: Writing) -> None:
        """Inside a transaction: no other process changes which tables there are."""
        ...

    def look(self, *, log: bool | None = None) -> None:
        """Is what lies below the tables sound? Of all; ``log``: of what is small, and of the log.

        Raises:
            StoreDamaged: it is not.
        """
        ...

    def again(self) -> Sql:
        """A second connection."""
        ...

    def copy_to(self, path: Path) -> None:
        """A consistent copy, as a file of SQLite."""
        ...

    def close(self) -> None:
        """Lets go of it."""
        ...


class Foreign(StoreError):
    """A file that says of itself that it is no store of this evertwin.

    >>> Foreign("robot.db").exit_code
    4
    """


class Database:
    """A connection. Its users take turns.

    >>> database = Database(MEMORY)
    >>> database.query("SELECT length FROM head")
    [(0,)]
    """

    now = "CAST((julianday('now') - 2440587.5) * 86400e6 AS INTEGER)"
    shared = ""
    locked = ""  # a transaction has the whole file to itself

    def __init__(self, path: str, *, read_only: bool = False) -> None:
        """Opens or creates.

        Raises:
            StoreError: a database of another program, or written by a newer evertwin.
            StoreDamaged: it cannot be read.
        """
        self.path = path
        self._read_only = read_only
        self._turn = threading.RLock()
        with self._guarded():
            self._db = self._connect()
        try:
            with self._guarded():
                self._prepare()
        except StoreError:
            self._db.close()
            raise

    def _connect(self) -> sqlite3.Connection:
        if not self._read_only:
            return self._opened(self.path)
        address = f"{Path(self.path).resolve().as_uri()}?mode=ro"
        found = self._opened(address)
        try:
            found.execute("PRAGMA user_version")
        except sqlite3.OperationalError:
            # where nothing may be written beside it, nothing changes either
            found.close()
            found = self._opened(f"{address}&immutable=1")
        return found

    def _opened(self, address: str) -> sqlite3.Connection:
        return sqlite3.connect(
            address, timeout=5, isolation_level=None, uri=self._read_only, check_same_thread=False
        )

    def _prepare(self) -> None:
        """Create what is missing, refuse what is foreign."""
        (version,) = self._db.execute("PRAGMA user_version").fetchone()
        (application,) = self._db.execute("PRAGMA application_id").fetchone()
        (tables,) = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if tables and application != APPLICATION:
            raise Foreign(f"{self.path}: a database of another program, expected a store")
        steps = upgrade(version, SCHEMA) if tables else ()
        if tables and version != SCHEMA and steps is None:
            newer = "newer" if version > SCHEMA else "older"
            raise Foreign(
                f"{self.path}: written by a {newer} evertwin (schema {version}, this one reads "
                f"{SCHEMA}): " + ("upgrade evertwin" if version > SCHEMA else "begin a new store")
            )
        if not self._read_only:
            self._db.execute(f"PRAGMA page_size = {PAGE}")
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = FULL")
        if not tables and self._read_only:
            raise Foreign(f"{self.path}: no such store: nothing was written to it yet")
        if not tables:
            self._create()
        elif steps:
            self._upgrade(version, steps)

    def _upgrade(self, version: int, steps: Sequence[str]) -> None:
        """All steps or none; the file as it was stands beside it before the first. Who only reads
        has a copy in memory."""
        if self._read_only:
            file, self._db = self._db, self._opened(MEMORY)
            file.backup(self._db)
            file.close()
        else:
            kept = Path(f"{self.path}.schema{version}")
            make_whole(kept, self.copy_to)
            said = "%s: upgraded from schema %d to %d; as it was it is kept as %s"
            log.warning(said, self.path, version, SCHEMA, kept.name)
        with self.transaction():
            for statement in steps:
                self._db.execute(statement)
            self._db.execute(f"PRAGMA user_version = {SCHEMA}")

    def _create(self) -> None:
        with self.transaction():
            for statement in _statements(TABLES):
                self._db.execute(statement)
            for kind, columns in VIEWS.items():
                fields = ", ".join(f"json_extract(content, '$.{c}') AS \"{c}\"" for c in columns)
                self._db.execute(
                    f"CREATE VIEW {kind}s AS SELECT run, row, {fields} FROM log "
                    f"WHERE kind = '{kind}'"
                )
            self._db.execute("INSERT INTO head VALUES (1, ?, ?, 0)", Head())
            self._db.execute(f"PRAGMA application_id = {APPLICATION}")
            self._db.execute(f"PRAGMA user_version = {SCHEMA}")

    def query(self, text: str, values: Sequence[Any] = ()) -> list[Any]:
        """All rows of a question.

        Raises:
            StoreDamaged: the file cannot be read.
        """
        with self._turn, self._guarded():
            return self._db.execute(text, values).fetchall()

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """What is written inside stands whole, and durable, or not at all."""
        with self._turn, self._guarded():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield self._db
                self._db.execute("COMMIT")
            finally:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")

    def samples(self) -> int:
        """Number of the newest samples that were ever stored; 0: there were none."""
        found = self.query("SELECT seq FROM sqlite_sequence WHERE name = 'samples'")
        return int(found[0][0]) if found else 0

    def numbered(self, db: Writing, newest: int) -> None:
        """SQLite counts by itself."""

    def alone(self, db: Writing) -> None:
        """A transaction has the whole file to itself."""

    def look(self, *, log: bool | None = None) -> None:
        """The chain holds the table; what is read through the index must be all of it."""
        if log is None or self.path == MEMORY or Path(self.path).stat().st_size <= SMALL:
            what = "1"
        elif log:
            what = "log"
        else:
            return
        ((said, *_), *_) = self.query(f"PRAGMA integrity_check({what})")
        if said != "ok":
            raise StoreDamaged(f"{self.path}: damaged: {said}")

    def again(self) -> Database:
        """A second connection to the file."""
        return Database(self.path)

    def copy_to(self, path: Path) -> None:
        """A consistent copy."""
        with self._turn, self._guarded():
            target = sqlite3.connect(path)
            try:
                self._db.backup(target)
            finally:
                target.close()

    def close(self) -> None:
        """Lets go of the file."""
        self._db.close()

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """What SQLite says becomes a store's error; a schema that is no text is not its own."""
        try:
            yield
        except sqlite3.OperationalError as error:
            # text that is no text has no code
            code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
            kind = StoreDamaged if code in DAMAGE else StoreUnwritable
            raise kind(f"{self.path}: {error}: check the disk and the folder's rights") from error
        except sqlite3.IntegrityError as error:
            raise StoreError(f"{self.path}: {error}") from error
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            raise StoreDamaged(f"{self.path}: {error}: check the disk") from error


def _statements(script: str) -> Iterator[str]:
    """The statements of a script; ``executescript`` would commit on its own."""
    text = ""
    for line in script.strip().splitlines():
        text += line + "\n"
        if sqlite3.complete_statement(text):
            yield text
            text = ""
