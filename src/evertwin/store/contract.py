"""The record of truth: what a twin has seen, decided and been, kept in order and for good.

A store returns from ``append`` and ``checkpoint`` only after the data is durable. The log is
append-only and chained by hashes: entry n carries the SHA-256 of entry n − 1 and of its own
content, so an entry that was changed, removed or slipped in is found and named by ``verify``.
Recovery is the newest checkpoint, then the rest of the input with the logged answers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

from evertwin.store.kinds import Kept

__all__ = ["Checkpoint", "Store"]

S = TypeVar("S")


class Checkpoint(NamedTuple):
    """A state and the row before which it was taken.

    >>> Checkpoint(100, (1.0,)).row
    100
    """

    row: int
    """Number of the next row to fold."""
    state: Any


@runtime_checkable
class Store(Protocol):
    """A durable, append-only log with checkpoints. `evertwin.store.check_store` tests its laws.

    >>> hasattr(Store, "append")
    True
    """

    def append(self, records: Sequence[Kept], row: int | None = None) -> None:
        """Add records to the log, in order, all or none; returns when they are durable.

        Args:
            records: events, requests, answers, versions, estimates.
            row: row that they precede, for records without a row of their own (answers).

        Raises:
            StoreError: closed, read only, or an answer without ``row``.
        """
        ...

    def read(self, kind: str, start: int = 0, stop: int | None = None) -> tuple[Kept, ...]:
        """Records of one kind whose row is in [start, stop), in the order of the log.

        Raises:
            StoreError: there is no such kind, or an entry cannot be read.
        """
        ...

    def checkpoint(self, state: Any, row: int) -> None:
        """Keep ``state`` (named tuples of arrays and scalars) as it is before ``row``; durable."""
        ...

    def restore(self, like: S, before: int | None = None) -> Checkpoint | None:
        """The newest checkpoint (before a row), in the shape of ``like``; None if there is none.

        Raises:
            StoreError: it does not match its hash, or was saved by another version.
        """
        ...

    def verify(self) -> int:
        """Number of entries, all of which match the chain.

        Raises:
            StoreError: names the first entry that does not.
        """
        ...

    def close(self) -> None:
        """Release the store; a second call does nothing."""
        ...
