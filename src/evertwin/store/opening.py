"""The store of a twin, to work with or to look at.

>>> opened(None).path
':memory:'
"""

from __future__ import annotations

from pathlib import Path

from evertwin.store.database import MEMORY
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
