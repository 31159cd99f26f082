"""The laws of a store, for any implementation of the contract.

>>> from evertwin.store import SqliteStore
>>> check_store(lambda: SqliteStore(":memory:"), persistent=False)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from evertwin.errors import LawBroken, StoreError, StoreLocked
from evertwin.fold import Chunk
from evertwin.fold.records import Answer, Event, Request
from evertwin.fold.state import equal
from evertwin.models.form import Form, Version
from evertwin.store.chain import Head
from evertwin.store.contract import Batch, Checkpoint, Progress, Store
from evertwin.store.kinds import Estimate, Kept


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
    law(
        "empty", (store.read("event"), store.restore(_state(0)), store.progress()), ((), None, None)
    )
    law("the head of an empty log", store.head, Head())
    _fill(store)
    _check_content(store)
    _check_refusals(store)
    if persistent:
        refuses("one owner", make, StoreLocked)
    head = store.head
    store.close()
    store.close()
    refuses("closed", lambda: store.read("event"))
    if persistent:
        again = make()
        law("the head is kept", again.head, head)
        _check_content(again)
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
    x = np.arange(10_000.0)
    x[seed] = -1.0
    return _State(x, (np.array([seed], dtype=np.int64), seed))


def _chunk(first: int) -> Chunk:
    t = np.arange(first, first + 3)
    return Chunk("pose", t, np.stack([t * 0.5, t * 0.1], axis=1), clock=(first, -7))


def _shown(first: int) -> dict[str, np.ndarray]:
    return {"row": np.arange(first, first + 2), "y": np.full((2, 3), float(first))}


def _fill(store: Store) -> None:
    """Three samples, seven records, two checkpoints, each batch with something of all."""
    records = _records()
    store.commit(Batch(records[:1], chunks=[_chunk(0)], run=1), wait=False)
    first = Checkpoint(10, _state(1), 1, shown=_shown(0))
    store.commit(Batch(records[1:4], row=5, run=1, checkpoint=first), wait=False)
    store.commit(Batch(records[4:6], chunks=[_chunk(3), _chunk(6)]))
    law("the end of a batch", store.head.length, 6)
    second = Checkpoint(20, _state(2), 1, shown=_shown(2))
    last = Batch(records[6:], run=1, checkpoint=second, progress=Progress(1, 20, "ab"))
    law("the head that a batch ends at", store.commit(last), store.head)


def _check_content(store: Store) -> None:
    records = _records()
    events = tuple(record for record in records if isinstance(record, Event))
    law("read gives what was committed, in order", store.read("event"), events)
    law("a range is [start, stop)", store.read("event", 5, 9), (events[1],))
    for kind, expected in (("request", 1), ("version", 2), ("answer", 3), ("estimate", 5)):
        law(f"{kind} comes back", store.read(kind), (records[expected],))
    entries = store.entries()
    law("every record stands once, in order", tuple(map(store.record, entries)), records)
    law("each with its run", [entry.run for entry in entries], [1, 1, 1, 1, 0, 0, 1])
    law("entries behind a position", store.entries(5), entries[5:])
    law("entries of a kind", store.entries(3, ["event"]), (entries[4], entries[6]))
    law("the head", store.head, Head(7, entries[-1].hash))
    law("verify counts", store.verify(Head(3, entries[2].hash)), 7)
    refuses("a head that never was", lambda: store.verify(Head(3, entries[3].hash)))
    law("progress", store.progress(), Progress(1, 20, "ab"))
    chunks = [(number, chunk.t.tolist()) for number, chunk in store.read_chunks(2)]
    law("samples by number", chunks, [(2, [3, 4, 5]), (3, [6, 7, 8])])
    (first,) = [chunk for _, chunk in store.read_chunks(1, 2)]
    law("a sample comes back", equal(tuple(first), tuple(_chunk(0))), True)
    _check_checkpoints(store)


def _check_checkpoints(store: Store) -> None:
    for before, number, length, chunks in ((None, 2, 7, 3), (20, 1, 4, 1)):
        found = store.restore(_state(0), before=before)
        if found is None or found.row != 10 * number or not equal(found.state, _state(number)):
            raise LawBroken(f"restore: expected the newest checkpoint before {before}, got {found}")
        law("a checkpoint knows its place in the log", found.length, length)
        law("a checkpoint knows its samples", found.chunks, chunks)
        rows = found.shown["row"].tolist()
        law("what is shown is appended", rows, list(range(2 * number)))
    law("nothing before the first checkpoint", store.restore(_state(0), before=10), None)
    law("the checkpoints of a run", store.restore(_state(0), run=2), None)


def _check_refusals(store: Store) -> None:
    """What cannot be kept whole is not kept at all."""
    refuses("unknown kind", lambda: store.read("wish"))
    whole = Batch([_records()[0], Answer(9, 0, {})], chunks=[_chunk(9)])
    refuses("an answer needs its row", lambda: store.commit(whole))
    whole = replace(whole, checkpoint=Checkpoint(30, _state(3), 1), progress=Progress(1, 30, "cd"))
    refuses("an answer needs its row", lambda: store.commit(whole))
    _check_content(store)


def law(name: str, found: object, expected: object) -> None:
    """Is ``found`` what the law of this name expects?"""
    if found != expected:
        raise LawBroken(f"{name}: expected {expected!r}, got {found!r}")


def refuses(name: str, call: Callable[[], object], error: type[StoreError] = StoreError) -> None:
    """Does the call end with the error that the law of this name expects?"""
    try:
        call()
    except error:
        return
    raise LawBroken(f"{name}: expected {error.__name__}, got no error")
