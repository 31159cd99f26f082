"""Who may write to a twin's store: one node at a time, for as long as its lease lasts.

A node that claims a twin gets a token, greater than any before. It renews its lease while it works;
a lease that ran out lets another node claim. Nothing tells the old node so: it may be paused, or
cut off. So each of its transactions asks, inside itself, whether its token still is the newest
(`fence`), and one under an older token is refused, whenever it comes. Leases are counted on the
store's clock alone: what time a node has does not matter.

>>> from evertwin.store.sql.database import Database
>>> database = Database(":memory:")
>>> owners = SqlOwners(database)
>>> owners.claim("arm", "north", 30.0), owners.claim("arm", "south", 30.0)
(1, None)
>>> owners.release("arm", 1), owners.claim("arm", "south", 30.0)
(True, 2)
>>> with database.transaction() as db:
...     fence("arm", 1)(db)
Traceback (most recent call last):
evertwin.errors.OwnershipLost: arm: refused: token 1 is old, node 'south' has 2 since
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import NamedTuple, Protocol, runtime_checkable

from evertwin.errors import OwnershipLost
from evertwin.store.sql.database import Sql, Writing
from evertwin.store.sql.tables import Fence

LOG = logging.getLogger("evertwin")
SECOND = 1_000_000
TABLE = """CREATE TABLE IF NOT EXISTS {shared}owners (
    twin text PRIMARY KEY, token bigint NOT NULL, node text NOT NULL, until bigint NOT NULL,
    wanted text NOT NULL, told text NOT NULL, UNIQUE (twin, token))"""
"""The token is part of a key: a claim, which changes it, waits for transactions that rely on it
(and they for it); to renew a lease changes no key and waits for none. No index is made beside it:
that would wait for every transaction on a table that is there."""


class Held(NamedTuple):
    """How it stands with one twin.

    >>> Held("arm", 3, "north", 4.5).wanted
    ''
    """

    twin: str
    token: int
    node: str
    """Who claimed it last."""
    left: float
    """Of the lease [s]; below zero: it has ended."""
    wanted: str = ""
    """The node that it is to move to; empty: any."""
    told: str = ""
    """What its owner says of it (JSON)."""


@runtime_checkable
class Owners(Protocol):
    """Leases and tokens, kept where the twins' stores are; `check_owners` tests its laws.

    Each call raises StoreUnwritable where the store cannot be reached.

    >>> isinstance(SqlOwners, type)
    True
    """

    def claim(self, twin: str, node: str, lease: float) -> int | None:
        """A token for a twin that nobody has; None: a lease of it lasts.

        Args:
            twin: name.
            node: who asks.
            lease: seconds.
        """
        ...

    def renew(self, told: Mapping[str, tuple[int, str]], lease: float) -> Mapping[str, str]:
        """Leases last for so many seconds from now.

        Args:
            told: by twin: its token, and what its owner says of it (JSON).
            lease: seconds.

        Returns:
            By twin that is still the owner's: where it is to move. One that lacks is lost.
        """
        ...

    def release(self, twin: str, token: int) -> bool:
        """Another node may claim it now; False: the token was old, nothing changes."""
        ...

    def want(self, twin: str, node: str) -> bool:
        """A twin is to move to a node (empty: any); False: nobody has ever claimed it."""
        ...

    def held(self) -> tuple[Held, ...]:
        """All twins that were ever claimed."""
        ...


def shared_table(database: Sql, name: str, text: str) -> str:
    """A table that all twins share, made where it is not there; its name for statements."""
    with database.transaction() as db:
        database.alone(db)
        db.execute(text.format(shared=database.shared))
    return f"{database.shared}{name}"


class SqlOwners:
    """In a table of the database that has the stores (`Owners` says what each method does).

    >>> from evertwin.store.sql.database import Database
    >>> SqlOwners(Database(":memory:")).held()
    ()
    """

    def __init__(self, database: Sql) -> None:
        self._db = database
        self._table = shared_table(database, "owners", TABLE)

    def claim(self, twin: str, node: str, lease: float) -> int | None:
        """A token for a twin that nobody has; None: a lease of it lasts."""
        now = self._db.now
        new = f"INSERT INTO {self._table} VALUES (?, 0, '', 0, '', '') ON CONFLICT DO NOTHING"
        taken = (
            f"UPDATE {self._table} SET token = token + 1, node = ?, until = {now} + ? "
            f"WHERE twin = ? AND until <= {now} RETURNING token"
        )
        with self._db.transaction() as db:
            db.execute(new, (twin,))
            found = list(db.execute(taken, (node, int(lease * SECOND), twin)))
        return int(found[0][0]) if found else None

    def renew(self, told: Mapping[str, tuple[int, str]], lease: float) -> Mapping[str, str]:
        """Leases last for so many seconds from now."""
        mine = {}
        one = (
            f"UPDATE {self._table} SET until = {self._db.now} + ?, told = ? "
            "WHERE twin = ? AND token = ? AND until > 0 RETURNING wanted"
        )
        with self._db.transaction() as db:
            for twin, (token, said) in sorted(told.items()):  # in one order: no two wait in a ring
                for (wanted,) in list(db.execute(one, (int(lease * SECOND), said, twin, token))):
                    mine[twin] = str(wanted)
        return mine

    def release(self, twin: str, token: int) -> bool:
        """Another node may claim it now; False: the token was old, nothing changes."""
        gone = f"UPDATE {self._table} SET until = 0 WHERE twin = ? AND token = ? RETURNING token"
        return bool(self._db.query(gone, (twin, token)))

    def want(self, twin: str, node: str) -> bool:
        """A twin is to move to a node (empty: any); False: nobody has ever claimed it."""
        there = f"UPDATE {self._table} SET wanted = ? WHERE twin = ? RETURNING twin"
        return bool(self._db.query(there, (node, twin)))

    def held(self) -> tuple[Held, ...]:
        """All twins that were ever claimed."""
        found = self._db.query(
            f"SELECT twin, token, node, until - {self._db.now}, wanted, told FROM {self._table} "
            "ORDER BY twin"
        )
        return tuple(Held(t, k, n, left / SECOND, w, s) for t, k, n, left, w, s in found)


def fence(twin: str, token: int, shared: str = "", locked: str = "") -> Fence:
    """What a transaction is held against: it is refused, and logged, where the token is old.

    Args:
        twin: name.
        token: that of the process that writes; 0: nobody has claimed it.
        shared: before the name of the table, as the database has it.
        locked: what keeps others from claiming until the transaction ends.
    """
    query = f"SELECT token, node FROM {shared}owners WHERE twin = ?{locked}"

    def check(db: Writing) -> None:
        newest, node = next(iter(db.execute(query, (twin,))), (0, ""))
        if newest != token:
            said = f"{twin}: refused: token {token} is old, node {node!r} has {newest} since"
            LOG.warning("%s", said, extra={"twin": twin, "event": "refused"})
            raise OwnershipLost(said)

    return check
