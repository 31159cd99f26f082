"""Is the log of a file what was written to it? All of it on demand, a share whenever it is opened.

>>> from evertwin.store.sql.database import Database
>>> database = Database(":memory:")
>>> verify(database, 0)[0], look(database, 0)
(Head(length=0, hash='287539cfca0c...'), 0)
"""

from __future__ import annotations

from evertwin.errors import StoreDamaged
from evertwin.store.chain import SEED, Entry, Head, chained
from evertwin.store.sql.database import Sql

LOOKED_AT = 20_000
"""Entries that are verified when a store is opened: the next ones, again and again around."""


def verify(database: Sql, length: int) -> tuple[Head, Head]:
    """The end of the log, all of which matches the chain, and where it was at a ``length``.

    Raises:
        StoreDamaged: names the first entry that does not.
    """
    database.look()
    at = there = Head()
    while part := _stored(database, at.length):
        inside = [entry for entry in part if entry.number <= length]
        passed = chained(inside, at)
        there = passed if passed.length <= length else there
        at = chained(part[len(inside) :], passed)
    _check_end(database, at)
    return at, there


def as_printed(given: Head, end: Head, there: Head) -> None:
    """Is a sound log the one whose head was printed? ``there``: its head at that length.

    Raises:
        StoreDamaged: it was rewritten, or ends before.
    """
    if end.length < given.length:
        raise StoreDamaged(f"log: it ends with entry {end.length}, expected {given.length}")
    if given.length and there.hash != given.hash:
        raise StoreDamaged(
            f"log: entry {given.length} has hash {there.hash[:12]}, expected "
            f"{given.hash[:12]}: the log was rewritten after that head was printed"
        )


def look(database: Sql, verified: int) -> int:
    """Verifies the entries whose turn it is: all of a short log, a share of a long one.

    Args:
        database: the store's.
        verified: the position that the last look came to.

    Returns:
        The position that this one came to.

    Raises:
        StoreDamaged: names the first entry that does not match.
    """
    head, _ = found_head(database)
    begin = verified if verified < head.length else 0
    before = database.query("SELECT hash FROM log WHERE number = ?", (begin,)) if begin else ()
    start = Head(begin, before[0][0] if before else SEED)
    at = chained(_stored(database, begin), start)
    if at.length - begin < LOOKED_AT:
        _check_end(database, at)
    database.look(log=head.length <= LOOKED_AT)
    return at.length


def found_head(database: Sql) -> tuple[Head, int]:
    """Where the log ends, and the position that the last look came to.

    Raises:
        StoreDamaged: it is lost.
    """
    found = database.query("SELECT length, hash, verified FROM head")
    if [type(value) for row in found for value in row] != [int, str, int]:
        raise StoreDamaged(f"{database.path}: where the log ends is lost")
    length, digest, verified = found[0]
    return Head(length, digest), verified


def _stored(database: Sql, after: int) -> list[Entry]:
    query = (
        "SELECT number, run, kind, row, content, hash FROM log WHERE number > ? "
        "ORDER BY number LIMIT ?"
    )
    return [Entry(*fields) for fields in database.query(query, (after, LOOKED_AT))]


def _check_end(database: Sql, at: Head) -> None:
    head, _ = found_head(database)
    if at != head:
        raise StoreDamaged(
            f"log: it ends with entry {at.length}, expected entry {head.length} with hash "
            f"{head.hash[:12]}: the end was cut off or changed"
        )
