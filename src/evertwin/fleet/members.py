"""The nodes of a fleet, as the shared store knows them: on its own clock, as leases are; and what
each says of twins that it would have to go on with.

>>> from evertwin.store.sql.database import Database
>>> members = Members(Database(":memory:"))
>>> members.beat("north", "https://192.0.2.1:8700", 10.0)
False
>>> [(one.node, one.left > 9.0) for one in members.all()]
[('north', True)]
"""

from __future__ import annotations

from typing import NamedTuple

from evertwin.store.owners.owners import SECOND, shared_table
from evertwin.store.sql.database import Sql

TABLE = """CREATE TABLE IF NOT EXISTS {shared}nodes (
    node text PRIMARY KEY, address text NOT NULL, until bigint NOT NULL, drains integer NOT NULL)"""
SAID = """CREATE TABLE IF NOT EXISTS {shared}loads (
    node text NOT NULL, twin text NOT NULL, token bigint NOT NULL, reason text NOT NULL,
    PRIMARY KEY (node, twin))"""


class Member(NamedTuple):
    """A node.

    >>> Member("north", "", 3.0, False).alive
    True
    """

    node: str
    address: str
    """Where its service is reached."""
    left: float
    """Seconds in which it is still taken for alive; below zero: it was not heard of for longer."""
    drains: bool
    """Does it give its twins up, and take no others?"""

    @property
    def alive(self) -> bool:
        """Was it heard of?"""
        return self.left > 0.0


class Says(NamedTuple):
    """What a node says of a twin.

    >>> Says("north", "arm", 3, "").reason
    ''
    """

    node: str
    twin: str
    token: int
    """Under which somebody had the twin when it looked."""
    reason: str
    """Why it cannot go on from the twin's state; empty: it can."""


class Members:
    """The tables of nodes, and of what they say. See the module.

    >>> Members.__name__
    'Members'
    """

    def __init__(self, database: Sql) -> None:
        self._db = database
        self._table = shared_table(database, "nodes", TABLE)
        self._said = shared_table(database, "loads", SAID)

    def beat(self, node: str, address: str, lease: float) -> bool:
        """A node is alive for so many seconds from now; is it to give up its twins?"""
        until = f"{self._db.now} + ?"
        text = (
            f"INSERT INTO {self._table} VALUES (?, ?, {until}, 0) ON CONFLICT (node) "
            "DO UPDATE SET until = excluded.until, address = excluded.address RETURNING drains"
        )
        ((drains,),) = self._db.query(text, (node, address, int(lease * SECOND)))
        return bool(drains)

    def leave(self, node: str) -> None:
        """A node ends."""
        self._db.query(f"UPDATE {self._table} SET until = 0 WHERE node = ? RETURNING 1", (node,))

    def drain(self, node: str, drains: bool) -> bool:
        """A node is to give up its twins and take no others, or may again; False: unknown."""
        text = f"UPDATE {self._table} SET drains = ? WHERE node = ? RETURNING node"
        return bool(self._db.query(text, (int(drains), node)))

    def all(self) -> tuple[Member, ...]:
        """All nodes that were ever heard of."""
        found = self._db.query(
            f"SELECT node, address, until - {self._db.now}, drains FROM {self._table} ORDER BY node"
        )
        return tuple(Member(n, a, left / SECOND, bool(d)) for n, a, left, d in found)

    def say(self, one: Says) -> None:
        """A node says whether it can go on from a twin's state."""
        text = (
            f"INSERT INTO {self._said} VALUES (?, ?, ?, ?) ON CONFLICT (node, twin) "
            "DO UPDATE SET token = excluded.token, reason = excluded.reason RETURNING 1"
        )
        self._db.query(text, one)

    def unsay(self, node: str) -> None:
        """A node begins anew: what it said is void."""
        self._db.query(f"DELETE FROM {self._said} WHERE node = ? RETURNING 1", (node,))

    def said(self) -> tuple[Says, ...]:
        """What all nodes say."""
        text = f"SELECT node, twin, token, reason FROM {self._said} ORDER BY twin, node"
        return tuple(Says(*one) for one in self._db.query(text))
