"""The laws of a store, for any implementation of the contract.

>>> from evertwin.store import SqliteStore
>>> check_store(lambda: SqliteStore(":memory:"), persistent=False)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from evertwin.errors import LawBroken, StoreError, StoreLocked
from evertwin.fold.records import Answer, Event, Request
from evertwin.fold.state import equal
from evertwin.models.form import Form, Version
from evertwin.store.contract import Store
from evertwin.store.kinds import Estimate, Kept

__all__ = ["check_store"]


class _State(NamedTuple):
    x: np.ndarray
    inner: tuple[np.ndarray, int]


def check_store(make: Callable[[], Store], *, persistent: bool = True) -> None:
    """Test the laws of a store.

    Args:
        make: opens the store; the first call must find it empty, each later one the same place.
        persistent: does a second opening find what the first one left?

    Raises:
        LawBroken: names the law: what was expected and what came.
    """
    store = make()
    records = _records()
    _law("empty", store.read("event"), ())
    _law("empty", store.restore(_state(0)), None)
    for record in records:
        store.append([record], row=5)
    _check_content(store, records)
    store.checkpoint(_state(1), 10)
    store.checkpoint(_state(2), 20)
    _check_checkpoints(store)
    _refuses("unknown kind", lambda: store.read("wish"))
    _refuses("an answer needs its row", lambda: store.append([Answer(9, 0, {})]))
    _law("all or none", store.read("answer"), tuple(r for r in records if isinstance(r, Answer)))
    if persistent:
        _refuses("one owner", make, StoreLocked)
    store.close()
    store.close()
    _refuses("closed", lambda: store.read("event"))
    if persistent:
        again = make()
        _check_content(again, records)
        _check_checkpoints(again)
        again.close()


def _records() -> tuple[Kept, ...]:
    return (
        Event(1, 10, "tuned", "Fc", "torque off by 9 %", {"before": 0.09, "rows": (1, 2)}),
        Request(1, "fit", 0, 2, 7, (0, 2), {"names": ("Fc",)}),
        Version(1, Form(), ("Fc",), (12.0,), 0, "tuned", 3),
        Answer(1, 0, {"values": (12.0,), "text": "σ = 0.1"}),
        Event(5, 50, "promoted", "", "better", {}),
        Estimate(5, 50, 1, "Fc", 12.0, -np.inf, np.inf, "not"),
        Event(9, 90, "rolled_back", "", "worse", {}),
    )


def _state(seed: int) -> _State:
    return _State(np.arange(3.0) + seed, (np.array([seed], dtype=np.int64), seed))


def _check_content(store: Store, records: tuple[Kept, ...]) -> None:
    events = tuple(record for record in records if isinstance(record, Event))
    _law("read gives what was appended, in order", store.read("event"), events)
    _law("a range is [start, stop)", store.read("event", 5, 9), (events[1],))
    for kind, expected in (("request", 1), ("version", 2), ("answer", 3), ("estimate", 5)):
        _law(f"{kind} comes back", store.read(kind), (records[expected],))
    if store.verify() < len(records):
        raise LawBroken(f"verify: expected at least {len(records)} entries, got {store.verify()}")


def _check_checkpoints(store: Store) -> None:
    for before, expected in ((None, 2), (20, 1)):
        found = store.restore(_state(0), before)
        if found is None or found.row != 10 * expected or not equal(found.state, _state(expected)):
            raise LawBroken(f"restore: expected the newest checkpoint before {before}, got {found}")
    _law("nothing before the first checkpoint", store.restore(_state(0), 10), None)


def _law(name: str, found: object, expected: object) -> None:
    if found != expected:
        raise LawBroken(f"{name}: expected {expected!r}, got {found!r}")


def _refuses(name: str, call: Callable[[], object], error: type[StoreError] = StoreError) -> None:
    try:
        call()
    except error:
        return
    raise LawBroken(f"{name}: expected {error.__name__}, got no error")
