"""The laws of ownership, for any implementation of the contract.

>>> from evertwin.store.sql.database import Database
>>> from evertwin.store.owners.owners import SqlOwners, fence
>>> from evertwin.store.sql.store import SqlStore
>>> import time
>>> database = Database(":memory:")
>>> def store(twin, token):
...     return SqlStore(database, fence=fence(twin, token))
>>> check_owners(SqlOwners(database), store, time.sleep)
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TypeAlias

from evertwin.errors import LawBroken, OwnershipLost
from evertwin.fold import Event
from evertwin.store.check import law, refuses
from evertwin.store.contract import Batch, Store
from evertwin.store.owners.owners import Owners

Opens: TypeAlias = Callable[[str, int], Store]
LEASE = 0.2
"""Seconds."""


def check_owners(owners: Owners, store: Opens, wait: Callable[[float], object]) -> None:
    """Test the laws of ownership, with the twins "a" and "b" that nobody has claimed yet.

    Args:
        owners: what is tested.
        store: opens the store of a twin under a token; that of "a" is written to.
        wait: lets so many seconds pass on the store's clock.

    Raises:
        LawBroken: names the law: what was expected and what came.
    """
    first = owners.claim("a", "north", LEASE)
    if first is None:
        raise LawBroken("a twin that nobody has can be claimed: expected a token, got None")
    law("one owner", owners.claim("a", "south", LEASE), None)
    law("one owner, also from the same node", owners.claim("a", "north", LEASE), None)
    law("each twin has its own", owners.claim("b", "south", LEASE) is not None, True)
    wait(0.75 * LEASE)
    law("renewed", owners.renew({"a": (first, "x")}, LEASE), {"a": ""})
    wait(0.75 * LEASE)
    law("a renewed lease lasts", owners.claim("a", "south", LEASE), None)
    law("where to", owners.want("a", "south"), True)
    law("an owner hears where to", owners.renew({"a": (first, "x")}, LEASE), {"a": "south"})
    law("nobody's cannot move", owners.want("c", "south"), False)
    old = store("a", first)
    try:
        _check_writing(owners, (store, old), wait, first)
    finally:
        _closed(old)


def _check_writing(
    owners: Owners, stores: tuple[Opens, Store], wait: Callable[[float], object], first: int
) -> None:
    """Who writes under which token."""
    store, old = stores
    old.commit(Batch([_event(1)]))
    wait(1.25 * LEASE)
    old.commit(Batch([_event(2)]))  # late, but nobody else has written meanwhile
    second = owners.claim("a", "south", 60.0)
    if second is None or second <= first:
        raise LawBroken(f"a later token is greater: expected more than {first}, got {second}")
    refuses("a commit under an old token", lambda: old.commit(Batch([_event(9)])), OwnershipLost)
    law("an old token renews nothing", owners.renew({"a": (first, "x")}, LEASE), {})
    law("an old token releases nothing", owners.release("a", first), False)
    new = store("a", second)
    law("nothing of what was refused stands", len(new.read("event")), 2)
    new.commit(Batch([_event(3)]))
    law("the new owner writes", len(new.read("event")), 3)
    found = {one.twin: one for one in owners.held()}["a"]
    law("who has it", (found.token, found.node, found.left > 50.0), (second, "south", True))
    law("released", owners.release("a", second), True)
    law("a released one is not renewed", owners.renew({"a": (second, "")}, LEASE), {})
    third = owners.claim("a", "north", LEASE)
    law("a released one can be claimed at once", third is not None and third > second, True)
    _closed(new)


def _closed(store: Store) -> None:
    """Closing tells again what was refused."""
    with suppress(OwnershipLost):
        store.close()


def _event(row: int) -> Event:
    return Event(row, 0, "tuned", "Fc", "", {})
