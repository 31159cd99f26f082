"""Settings of the store."""

from __future__ import annotations

from dataclasses import dataclass

from evertwin.settings.section import Section


@dataclass(frozen=True)
class StoreSpec(Section):
    """``[store]``: where versions, events and checkpoints are kept.

    >>> StoreSpec().path is None
    True
    """

    path: str | None = None
    """SQLite file, relative to the twin file; absent: in memory."""
