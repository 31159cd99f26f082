"""The record of truth: samples, states, versions, events, requests, answers, estimates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.store.chain import Entry, Head
    from evertwin.store.check import check_store
    from evertwin.store.contract import Batch, Checkpoint, Progress, Store
    from evertwin.store.kinds import Estimate, Kept
    from evertwin.store.opening import opened
    from evertwin.store.sqlite import SqliteStore

__all__ = [
    "Batch",
    "Checkpoint",
    "Entry",
    "Estimate",
    "Head",
    "Kept",
    "Progress",
    "SqliteStore",
    "Store",
    "check_store",
    "opened",
]

__getattr__ = surface(__name__)
