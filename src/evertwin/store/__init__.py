"""The record of truth: samples, states, versions, events, requests, answers, estimates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.store.chain import Entry as Entry, Head as Head
    from evertwin.store.check import check_store as check_store
    from evertwin.store.contract import (
        Batch as Batch,
        Checkpoint as Checkpoint,
        Progress as Progress,
        Store as Store,
    )
    from evertwin.store.kinds import Estimate as Estimate, Kept as Kept
    from evertwin.store.opening import looked_at as looked_at, opened as opened, restore as restore
    from evertwin.store.owners.laws import check_owners as check_owners
    from evertwin.store.owners.owners import Held as Held, Owners as Owners, SqlOwners as SqlOwners
    from evertwin.store.postgres.store import SharedStore as SharedStore
    from evertwin.store.sql.store import SqlStore as SqlStore
    from evertwin.store.sqlite.store import SqliteStore as SqliteStore

__getattr__ = surface(__name__)
