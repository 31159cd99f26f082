"""The tables of a store's file, written batch by batch.

>>> OLD.partition(" ")[0]
'number'
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from evertwin.fold import Chunk
from evertwin.store.chain import Entry
from evertwin.store.contract import Batch
from evertwin.store.sql.arrays import pack
from evertwin.store.sql.checkpoints import Checkpoints
from evertwin.store.sql.database import Sql, Writing
from evertwin.store.sql.pieces import name_of, proof

OLD = "number <= coalesce((SELECT min(chunks) FROM checkpoints), 9223372036854775807)"
FORGET = f"DELETE FROM samples WHERE source = ? AND stop < ? AND {OLD}"
Fence: TypeAlias = Callable[[Writing], None]
"""Raises, inside a transaction, where what it would write is no longer this process's to write."""
MOVE = "DELETE FROM samples WHERE source = ? AND stop >= ? AND stop < ? AND number <= ?"


class Job(NamedTuple):
    """A batch, ready to be written.

    >>> Job((), Batch()).entries
    ()
    """

    entries: tuple[Entry, ...]
    batch: Batch


class Tables:
    """The tables, written batch by batch.

    >>> from evertwin.store.sql.database import Database
    >>> database = Database(":memory:")
    >>> tables = Tables(database, Checkpoints(database))
    >>> tables.write([Job((), Batch(moved=[("arm", 0, 1, 1)]))])
    """

    def __init__(self, database: Sql, checkpoints: Checkpoints, fence: Fence | None = None) -> None:
        self.database = database
        self.checkpoints = checkpoints
        self.fence = fence
        self.verified = 0
        self.samples = database.samples()
        """Number of the newest ones."""

    def write(self, jobs: list[Job]) -> None:
        """Several batches in one transaction."""
        newest = next((k for k in reversed(range(len(jobs))) if jobs[k].batch.checkpoint), -1)
        with self.database.transaction() as db:
            if self.fence is not None:
                self.fence(db)
            for k, (entries, batch) in enumerate(jobs):
                if batch.chunks:
                    self.database.numbered(db, self.samples + len(batch.chunks))
                    every = enumerate(batch.chunks, self.samples + 1)
                    db.executemany("INSERT INTO samples VALUES (?, ?, ?, ?, ?, ?, ?)",
                                   [(number, *_sample(one)) for number, one in every])  # fmt: skip
                    self.samples += len(batch.chunks)
                if entries:
                    db.executemany("INSERT INTO log VALUES (?, ?, ?, ?, ?, ?)", entries)
                    end = (entries[-1].number, entries[-1].hash, self.verified)
                    db.execute("UPDATE head SET length = ?, hash = ?, verified = ?", end)
                if batch.progress is not None:
                    db.execute("DELETE FROM progress")
                    db.execute("INSERT INTO progress VALUES (1, ?, ?, ?, ?)",
                               (*batch.progress, proof(*batch.progress)))  # fmt: skip
                if batch.heard:
                    db.execute("DELETE FROM inbox WHERE number <= ?", (batch.heard,))
                if batch.checkpoint is not None:
                    self.checkpoints.write(db, batch.checkpoint, self.samples, whole=k == newest)
                if batch.forget:
                    db.executemany(FORGET, batch.forget.items())
                if batch.moved:
                    db.executemany(MOVE, batch.moved)


def _sample(chunk: Chunk) -> tuple[Any, ...]:
    """A chunk as a row of the table."""
    clock = {} if chunk.clock is None else {"clock": np.array(chunk.clock, dtype=np.int64)}
    content = pack({"t": chunk.t, "v": chunk.v, **clock})
    told = (chunk.source, chunk.task, int(chunk.t[0]), int(chunk.t[-1]))
    return (*told, content, proof(*told, name_of(content)))
