"""Settings of the store."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from evertwin.settings.section import Section


@dataclass(frozen=True)
class StoreSpec(Section):
    """``[store]``: where versions, events and checkpoints are kept.

    >>> StoreSpec().path is None
    True
    """

    path: str | None = None
    """SQLite file, relative to the twin file; or a PostgreSQL server, as in
    "postgresql://user@host/database" (extra ``fleet``); absent: in memory."""

    @property
    def server(self) -> str | None:
        """The server, where it is one."""
        told = self.path or ""
        return told if told.startswith(("postgresql://", "postgres://")) else None

    def place(self, folder: str | Path) -> Path | str | None:
        """Where it is: a file, a server, or in memory.

        >>> StoreSpec("a.db").place("hall").as_posix(), StoreSpec("postgresql:///x").place("hall")
        ('hall/a.db', 'postgresql:///x')
        """
        return self.server or (None if self.path is None else Path(folder) / self.path)
