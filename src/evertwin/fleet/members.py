"""The nodes of a fleet, as the shared store knows them: on its own clock, as leases are.

>>> from evertwin.store.database import Database
>>> members = Members(Database(":memory:"))
>>> members.beat("north", "https://192.0.2.1:8700", 10.0)
False
>>> [(one.node, one.left > 9.0) for one in members.all()]
[('north', True)]
"""

from __future__ import annotations

from typing import NamedTuple

from evertwin.store.database import Sql
from evertwin.store.owners import SECOND, shared_table

TABLE = """CREATE TABLE IF NOT EXISTS {shared}nodes (
    node text PRIMARY KEY, address text NOT NULL, until bigint NOT NULL, drains integer NOT NULL)"""


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


class Members:
    """The table of nodes. See the module.

    >>> Members.__name__
    'Members'
    """

    def __init__(self, database: Sql) -> None:
        self._db = database
        self._table = shared_table(database, "nodes", TABLE)

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
