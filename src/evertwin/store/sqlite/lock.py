"""One owner at a time: a second process is refused and told who the owner is.

The lock is a write lock that SQLite holds on a small file beside the store. The operating system
drops it when the process ends, however it ends, so a lock is never left behind; the owner's process
number stays readable meanwhile.
"""

from __future__ import annotations

import os
import socket
import sqlite3
from pathlib import Path

from evertwin.errors import StoreLocked, StoreUnwritable

CHECK = "check the folder and its rights"


class Lock:
    """The lock of one store file.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     lock = Lock(Path(folder) / "robot.db")
    ...     try:
    ...         Lock(Path(folder) / "robot.db")
    ...     except StoreLocked as error:
    ...         print(error.exit_code, str(os.getpid()) in str(error))
    ...     lock.release()
    75 True
    """

    def __init__(self, path: Path) -> None:
        """Take the lock.

        Raises:
            StoreLocked: another process, or another store of this one, has it.
            StoreUnwritable: the folder is missing or cannot be written.
        """
        try:
            self._file = sqlite3.connect(f"{path}.lock", timeout=0, isolation_level=None)
        except sqlite3.OperationalError as error:
            raise StoreUnwritable(f"{path}: {error}: {CHECK}") from error
        try:
            self._take()
        except sqlite3.OperationalError as error:
            owner = self._owner()
            self._file.close()
            if error.sqlite_errorcode not in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                raise StoreUnwritable(f"{path}: {error}: {CHECK}") from error
            raise StoreLocked(
                f"{path} is open in {owner}: wait until it ends, or end it"
            ) from error

    def _take(self) -> None:
        """Write the owner's name, then hold a second transaction open for good."""
        self._file.execute("BEGIN IMMEDIATE")
        self._file.execute("CREATE TABLE IF NOT EXISTS owner (pid INTEGER, host TEXT)")
        self._file.execute("DELETE FROM owner")
        owner = (os.getpid(), socket.gethostname())
        self._file.execute("INSERT INTO owner VALUES (?, ?)", owner)
        self._file.execute("COMMIT")
        self._file.execute("BEGIN IMMEDIATE")

    def _owner(self) -> str:
        try:
            row = self._file.execute("SELECT pid, host FROM owner").fetchone()
        except sqlite3.OperationalError:
            row = None  # the owner is just writing its name
        return f"process {row[0]} on {row[1]}" if row else "another process"

    def release(self) -> None:
        """Give the lock back."""
        self._file.close()
