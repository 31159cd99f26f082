"""The record of truth: what a twin has seen, decided and been, kept in order and for good.

A store takes *batches*. A batch is durable whole or not at all: the samples that came, what the
fold said of them, the versions it made and the state after them stand together or are not there.
The log is append-only and chained by hashes: entry n carries the SHA-256 of entry n − 1 and of its
own content, so an entry that was changed, removed or slipped in is found and named.

A checkpoint names the position in the log that its state belongs to. Recovery is the newest
checkpoint, then the rest of the input: what the fold says again is compared with the log from that
position on, so that every record stands there exactly once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from evertwin.fold import Chunk, Event
from evertwin.store.chain import Entry, Head
from evertwin.store.kinds import Kept

S = TypeVar("S")


class Checkpoint(NamedTuple):
    """A state and what it is the state of.

    >>> Checkpoint(100, (1.0,)).row
    100
    """

    row: int
    """Number of the next row to fold."""
    state: Any
    """Named tuples of arrays and scalars."""
    run: int = 0
    length: int = -1
    """Position in the log that it belongs to: the end of its batch."""
    chunks: int = -1
    """Samples up to this number are in it; in a batch −1: all that were stored so far."""
    shown: Mapping[str, np.ndarray] = {}
    """Columns of rows that are kept for being looked at: in a batch those since the run's last
    checkpoint, restored all of the run so far."""


class Progress(NamedTuple):
    """How far a run has come in its data.

    >>> Progress(1, 20, "00").rows
    20
    """

    run: int
    rows: int
    """Rows folded."""
    digest: str
    """Hash over them."""


@dataclass(frozen=True)
class Batch:
    """What becomes durable together.

    >>> Batch(row=5).records
    ()
    """

    records: Sequence[Kept] = ()
    """Entries of the log, in order: versions, events, requests, answers, estimates."""
    row: int | None = None
    """Row that they precede, for records without a row of their own (answers)."""
    run: int = 0
    """Run that says them; 0: said from outside of any."""
    chunks: Sequence[Chunk] = ()
    """Samples as they arrived; before what the fold says of them."""
    checkpoint: Checkpoint | None = None
    """The state after all this. The store may read it later: hand over a copy."""
    progress: Progress | None = None
    heard: int = 0
    """What was asked for up to this number (`Store.asked`) is in ``records`` now."""
    forget: Mapping[str, int] = field(default_factory=dict)
    """Source → stamp [ns]: its samples that ended before may go, where no checkpoint needs them."""
    moved: Sequence[tuple[str, int, int, int]] = ()
    """Source, span [ns] and last number of pieces that go because ``records`` name their file."""


@runtime_checkable
class Store(Protocol):
    """A durable, append-only log with samples and checkpoints; `check_store` tests its laws.

    >>> hasattr(Store, "commit")
    True
    """

    @property
    def head(self) -> Head:
        """Where the log ends."""
        ...

    def commit(self, batch: Batch, *, wait: bool = True) -> Head:
        """Takes a batch, after those before it; the head of the log with it.

        Args:
            batch: durable whole or not at all.
            wait: return when it is durable; else at once, and durable after the next call that
                waits. Either way batches become durable in their order.

        Raises:
            StoreError: closed, read only, an answer without its row, or an earlier batch that
                could not be written.
        """
        ...

    def flush(self) -> None:
        """Returns when everything is durable."""
        ...

    def read(self, kind: str, start: int = 0, stop: int | None = None) -> tuple[Kept, ...]:
        """Records of one kind whose row is in [start, stop), in the order of the log.

        Raises:
            StoreError: there is no such kind.
            StoreDamaged: an entry does not match its hash or cannot be read.
        """
        ...

    def entries(
        self, after: int = 0, kinds: Sequence[str] = (), most: int = -1
    ) -> tuple[Entry, ...]:
        """Entries of the log behind a position, in order; of some kinds, or all; the first so many.

        Raises:
            StoreDamaged: an entry does not match its hash.
        """
        ...

    @property
    def chunks(self) -> int:
        """Number of the newest samples, also if they are no longer kept; 0: there were none."""
        ...

    def read_chunks(self, start: int = 1, stop: int | None = None) -> Iterator[tuple[int, Chunk]]:
        """Samples by number (from 1, in order of arrival), those in [start, stop) that are kept."""
        ...

    def samples(self, source: str, first: int, last: int) -> Iterator[Chunk]:
        """What is kept of a source with stamps in [first, last] [ns], in order of arrival."""
        ...

    def newest(self, source: str) -> tuple[int, int] | None:
        """Task and stamp [ns] of the newest sample of a source; None: it has none."""
        ...

    def restore(
        self, like: S, run: int | None = None, before: int | None = None
    ) -> Checkpoint | None:
        """The newest sound checkpoint (of a run, before a row) in the shape of ``like``, or None.

        Raises:
            StoreError: it was saved by another version.
        """
        ...

    def ask(self, events: Sequence[Event]) -> None:
        """Asks the process that works with the store, where this one only reads it.

        Raises:
            StoreError: the store cannot be written.
        """
        ...

    def asked(self) -> tuple[tuple[Event, ...], int]:
        """What other processes have asked for and no batch has heard, and its last number."""
        ...

    def progress(self) -> Progress | None:
        """How far the newest run has come; None: not known."""
        ...

    def verify(self, head: Head | None = None) -> int:
        """Number of entries, all of which match the chain, and ``head`` if one is given.

        Raises:
            StoreDamaged: names the first that does not.
        """
        ...

    def recover(self) -> Event:
        """Starts anew from what is sound, where damage was found; the event says what is lost.

        Raises:
            StoreError: there is nothing to start from.
        """
        ...

    def backup(self, path: Path) -> None:
        """A copy of everything that is durable, whole or not at all, while work goes on."""
        ...

    def record(self, entry: Entry) -> Kept:
        """The record that an entry holds."""
        ...

    def close(self) -> None:
        """Makes all durable and releases the store; a second call does nothing."""
        ...
