"""The store of a twin, to work with or to look at.

>>> opened(None).path
':memory:'
"""

from __future__ import annotations

import os
import shutil
from contextlib import closing
from pathlib import Path

import evertwin.store as room  # what speaks with a server is loaded where there is one
from evertwin.errors import NoStore, StoreError
from evertwin.store.sql.database import MEMORY
from evertwin.store.sql.store import SqlStore
from evertwin.store.sqlite.lock import Lock
from evertwin.store.sqlite.store import SqliteStore


def opened(place: Path | str | None, twin: str = "", *, reading: bool = False) -> SqlStore:
    """The store of a twin at a place; in memory without one.

    Args:
        place: its file, or a server.
        twin: its name, by which a server knows it.
        reading: as it is, while another process may be writing: no lock is taken and nothing is
            created; where there is no store yet, an empty one in memory.

    Raises:
        StoreLocked: another process has it.
        StoreError: it is no store.
    """
    if place is None:
        return SqliteStore(MEMORY)
    if reading:
        try:
            return looked_at(place, twin)
        except NoStore:
            return SqliteStore(MEMORY)
    return SqliteStore(place) if isinstance(place, Path) else room.SharedStore(place, twin)


def looked_at(place: Path | str, twin: str) -> SqlStore:
    """A store to look at, while another process may be writing.

    Raises:
        NoStore: there is none yet.
        StoreError: it cannot be read.
    """
    if isinstance(place, Path):
        return SqliteStore(place, read_only=True)
    return room.SharedStore(place, twin, read_only=True)


def restore(path: Path, backup: Path) -> int:
    """Puts a backup in the place of a store; what stood there is kept as ``….before``.

    Args:
        path: of the store.
        backup: as `SqliteStore.backup` wrote it.

    Returns:
        Entries of its log.

    Raises:
        StoreDamaged: the backup does not match its hashes; nothing was changed.
        StoreLocked: another process works with the store.
        StoreError: a store was set aside there before.
    """
    with closing(SqliteStore(backup, read_only=True)) as store:
        entries = store.verify()
        store.archive.copy_to(path)  # files of days have names of their own: none is in the way
    aside = path.with_name(path.name + ".before")
    if aside.exists():
        raise StoreError(f"{aside}: exists already: move it away, then restore again")
    lock = Lock(path)
    try:
        part = path.with_name(path.name + ".part")
        shutil.copyfile(backup, part)
        with part.open("rb+") as written:
            os.fsync(written.fileno())
        for tail in ("-wal", "-shm", ""):  # its log goes with a store, else it would change the new
            own = path.with_name(path.name + tail)
            if own.exists():
                own.replace(aside.with_name(aside.name + tail))
        part.replace(path)
    finally:
        lock.release()
    return entries
