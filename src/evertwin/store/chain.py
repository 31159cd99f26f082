"""The hash chain: what makes a log tamper-evident.

``h_0 = sha256(seed)``, ``h_n = sha256(h_{n-1} ‖ canonical(n, kind, row, content))``. Changing,
removing or inserting an entry breaks the chain at that entry; the number of entries and the last
hash are kept beside the log, so a cut-off end shows too.

>>> first = link(SEED, 1, "event", 7, "{}")
>>> first == link(SEED, 1, "event", 7, "{}"), first == link(SEED, 1, "event", 8, "{}")
(True, False)
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import NamedTuple

from evertwin.errors import StoreError

__all__ = ["SEED", "Entry", "Head", "link", "verify"]

SEED = hashlib.sha256(b"evertwin log 1").hexdigest()
"""Hash before the first entry."""


class Entry(NamedTuple):
    """One line of the log.

    >>> Entry(1, "event", 7, "{}", "00").kind
    'event'
    """

    number: int
    """From 1, without gaps."""
    kind: str
    row: int
    content: str
    """JSON text."""
    hash: str


class Head(NamedTuple):
    """Where the log ends.

    >>> Head().length
    0
    """

    length: int = 0
    hash: str = SEED


def link(before: str, number: int, kind: str, row: int, content: str) -> str:
    """Hash of an entry, given the hash of the one before."""
    text = f"{before}\n{number}\n{kind}\n{row}\n{content}"
    return hashlib.sha256(text.encode()).hexdigest()


def verify(entries: Iterable[Entry], head: Head) -> int:
    """Number of entries, all of which match.

    Raises:
        StoreError: names the first entry that is missing or does not match.
    """
    at = Head()
    for entry in entries:
        if entry.number != at.length + 1:
            raise StoreError(
                f"log: expected entry {at.length + 1}, got entry {entry.number}: entries were "
                "removed or added; restore a backup, entries before it are sound"
            )
        expected = link(at.hash, entry.number, entry.kind, entry.row, entry.content)
        if entry.hash != expected:
            raise StoreError(
                f"log: entry {entry.number} ({entry.kind}, row {entry.row}) does not match its "
                "hash: it was changed; restore a backup, entries before it are sound"
            )
        at = Head(entry.number, entry.hash)
    if at != head:
        raise StoreError(
            f"log: it ends with entry {at.length}, expected entry {head.length} with hash "
            f"{head.hash[:12]}: the end was cut off or changed; restore a backup"
        )
    return at.length
