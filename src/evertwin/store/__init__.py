"""The record of truth: checkpoints, versions, events, requests, answers, parameter history."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.store.check import check_store
    from evertwin.store.contract import Checkpoint, Store
    from evertwin.store.kinds import Estimate, Kept
    from evertwin.store.sqlite import SqliteStore

__all__ = ["Checkpoint", "Estimate", "Kept", "SqliteStore", "Store", "check_store"]

__getattr__ = surface(__name__)
