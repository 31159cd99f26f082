"""What can be kept, and how it is written: one JSON text a record, plain scalars only.

>>> from evertwin.fold import Event
>>> event = Event(row=7, time=70, kind="tuned", signal="Fc", reason="torque off by 9 %")
>>> kind_of(event), decode("event", json.loads(encode(event))) == event
('event', True)
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from evertwin.errors import StoreError, naming
from evertwin.fold.records import Answer, Event, Request, canonical, plain
from evertwin.models.form import Version


@dataclass(frozen=True)
class Estimate:
    """One parameter at one time: an entry of the parameter history.

    >>> Estimate(row=10, time=1, version=2, name="Fc", value=12.1, low=11.9, high=12.3).verdict
    'identifiable'
    """

    row: int
    """Row at which it became known."""
    time: int
    """Stamp of that row [ns]."""
    version: int
    """Version that carries it."""
    name: str
    value: float
    """SI."""
    low: float
    """Lower end of the 95 % interval; −inf where the data says nothing."""
    high: float
    """Upper end."""
    verdict: str = "identifiable"
    """identifiable, weak or not."""
    task: int = 0
    """Task of that row, counted from the start of its run."""
    elapsed: int = 0
    """Time within tasks up to that row, from the start of its run [ns]."""
    tasks_before: int = 0
    """Tasks of the runs before its own, also of those in which nothing was tuned."""
    elapsed_before: int = 0
    """Time within these tasks [ns]."""


Kept: TypeAlias = Event | Request | Answer | Version | Estimate


def _request(content: Mapping[str, Any]) -> Request:
    start, stop = content["window"]
    return Request(**{**content, "window": (start, stop), "detail": plain(content["detail"])})


def _estimate(content: Mapping[str, Any]) -> Estimate:
    low, high = content["low"], content["high"]
    ends = (-math.inf if low is None else low, math.inf if high is None else high)
    return Estimate(**{**content, "low": ends[0], "high": ends[1]})


def _version(content: Mapping[str, Any]) -> Version:
    given = dict(content)
    named = given.pop("hash")
    version = Version.from_json(given)
    if version.hash != named:
        raise StoreError(f"version {version.number}: its content does not match its hash {named}")
    return version


KINDS: Mapping[str, tuple[type, Callable[[Mapping[str, Any]], Kept]]] = {
    "answer": (Answer, lambda content: Answer(**content)),
    "estimate": (Estimate, _estimate),
    "event": (Event, lambda content: Event(**content)),
    "request": (Request, _request),
    "version": (Version, _version),
}
"""Name of each kind, its class, and what builds it from its content."""


def kind_of(record: Kept) -> str:
    """The kind's name.

    Raises:
        StoreError: it is nothing that a store keeps.
    """
    for name, (kind, _) in KINDS.items():
        if type(record) is kind:
            return name
    raise StoreError(f"expected one of {', '.join(KINDS)}, got {type(record).__name__}")


def row_of(record: Kept, row: int | None) -> int:
    """The row at which it became known.

    Raises:
        StoreError: neither the record nor the caller says.
    """
    own = getattr(record, "row", row)
    if own is None:
        raise StoreError(f"{kind_of(record)}: needs the row that it precedes: Batch(row=...)")
    return int(own)


def encode(record: Kept) -> str:
    """The one JSON text of a record. A version carries its hash."""
    if not isinstance(record, Version):
        return canonical(record)
    fields = {f.name: getattr(record, f.name) for f in dataclasses.fields(record)}
    return canonical({**fields, "hash": record.hash})


def decode(kind: str, content: Mapping[str, Any]) -> Kept:
    """The record that ``encode`` was given.

    Raises:
        StoreError: an unknown kind, or content that does not fit it.
    """
    if kind not in KINDS:
        raise StoreError(f"expected one of {', '.join(KINDS)}, got {kind!r}")
    with naming(f"{kind}: does not fit its form", (TypeError, ValueError, KeyError), StoreError):
        return KINDS[kind][1](content)


def loads(text: str) -> Any:
    """JSON text as plain values; a list becomes a tuple, as it was."""
    return plain(json.loads(text))
