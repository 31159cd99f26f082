"""The store of a twin, to work with or to look at.

>>> opened(None).path
':memory:'
"""

from __future__ import annotations

import os
import shutil
from contextlib import closing
from pathlib import Path

from evertwin.errors import StoreError
from evertwin.store.database import MEMORY
from evertwin.store.lock import Lock
from evertwin.store.sqlite import SqliteStore


def opened(path: Path | None, *, reading: bool = False) -> SqliteStore:
    """The store at ``path``; in memory without one.

    Args:
        path: its file.
        reading: as it is, while another process may be writing: no lock is taken and nothing is
            created; where there is no store yet, an empty one in memory.

    Raises:
        StoreLocked: another process has it.
        StoreError: it is no store.
    """
    if path is None or (reading and not path.is_file()):
        return SqliteStore(MEMORY)
    return SqliteStore(path, read_only=reading)


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
