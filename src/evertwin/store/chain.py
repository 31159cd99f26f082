"""The hash chain: what makes a log tamper-evident.

``h_0 = sha256(seed)``, ``h_n = sha256(h_{n-1} ‖ canonical(n, run, kind, row, content))``. Changing,
removing or inserting an entry breaks the chain at that entry. Whoever recomputes every hash after a
change gets another head; so a head that was written down elsewhere tells a rewritten log.

>>> first = link(SEED, 1, 0, "event", 7, "{}")
>>> first == link(SEED, 1, 0, "event", 7, "{}"), first == link(SEED, 1, 0, "event", 8, "{}")
(True, False)
"""

from __future__ import annotations

import hashlib
import hmac
import re
from collections.abc import Iterable
from typing import NamedTuple

from evertwin.errors import StoreDamaged, UsageError

SEED = hashlib.sha256(b"evertwin log 2").hexdigest()
"""Hash before the first entry; another form of the store has another."""
PRINTED = re.compile(r"(\d+):([0-9a-f]{64})(?::([0-9a-f]{64}))?")


class Entry(NamedTuple):
    """One line of the log.

    >>> Entry(1, 0, "event", 7, "{}", "00").kind
    'event'
    """

    number: int
    """From 1, without gaps: the position in the log."""
    run: int
    """Run that says it, from 1; 0: said from outside of any (an operator, a command)."""
    kind: str
    row: int
    content: str
    """JSON text."""
    hash: str


class Head(NamedTuple):
    """Where the log ends; printed, it is what a later log is checked against.

    >>> Head().length
    0
    >>> Head.parse(Head().printed(b"secret"), b"secret") == Head()
    True
    """

    length: int = 0
    hash: str = SEED

    def printed(self, key: bytes = b"") -> str:
        """``LENGTH:HASH``, and ``:SIGNATURE`` (HMAC-SHA256) with a key."""
        text = f"{self.length}:{self.hash}"
        return f"{text}:{_signature(text, key)}" if key else text

    @classmethod
    def parse(cls, text: str, key: bytes = b"") -> Head:
        """The head that was printed.

        Raises:
            UsageError: it is none, is not signed though there is a key, or was signed by another.
        """
        found = PRINTED.fullmatch(text.strip())
        if found is None:
            raise UsageError(
                f"head: expected LENGTH:HASH as 'evertwin store head' prints, got {text!r}"
            )
        length, digest, signature = found.groups()
        if key and not hmac.compare_digest(signature or "", _signature(f"{length}:{digest}", key)):
            raise UsageError("head: its signature is not one of this key: another key, or forged")
        return cls(int(length), digest)


def _signature(text: str, key: bytes) -> str:
    return hmac.new(key, text.encode(), hashlib.sha256).hexdigest()


def link(before: str, *fields: object) -> str:
    """Hash of an entry, given that before: of its number, run, kind, row, content.

    A damaged file may hold anything in their place.
    """
    return hashlib.sha256("\n".join([before, *map(str, fields)]).encode()).hexdigest()


def chained(entries: Iterable[Entry], begin: Head) -> Head:
    """The head after entries that follow ``begin``, all of which match.

    Raises:
        StoreDamaged: names the first entry that is missing or does not match.
    """
    at = begin
    for entry in entries:
        if entry.number != at.length + 1:
            raise StoreDamaged(
                f"log: expected entry {at.length + 1}, got entry {entry.number}: entries were "
                "removed or added; entries before it are sound"
            )
        if entry.hash != link(at.hash, *entry[:-1]):
            raise StoreDamaged(
                f"log: entry {entry.number} ({entry.kind}, row {entry.row}) does not match its "
                "hash: it was changed; entries before it are sound"
            )
        at = Head(entry.number, entry.hash)
    return at
