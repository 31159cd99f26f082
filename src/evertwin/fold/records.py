"""Records: what the stream says about itself. Plain Python scalars only, so that equal runs hash
equal; no wall clock.

Order of the log: (row at which it became *known*, stage, sequence).

>>> Event(row=7, time=70, kind="overruled", signal="x", reason="vote passed").evidence
{}
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from evertwin.errors import DataError
from evertwin.types import Json


def interval(ends: Sequence[float | None] | None) -> tuple[float | None, float | None] | None:
    """Both ends of an interval; None where neither is known.

    >>> interval((1.0, math.inf)), interval((None, None)), interval((-math.inf, math.inf))
    ((1.0, inf), None, None)
    """
    low, high = ends or (None, None)
    known = any(end is not None and math.isfinite(end) for end in (low, high))
    return (low, high) if known else None


def plain(value: object) -> Json:
    """``value`` as plain Python scalars, tuples and dictionaries; NumPy and dataclasses included.

    NaN and infinities become None: a log must be readable by every strict JSON parser.

    >>> plain({"a": np.float64(1.5), "b": np.array([1, 2]), "c": float("nan")})
    {'a': 1.5, 'b': (1, 2), 'c': None}
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f" and value.ndim == 1:  # at once: columns are long
            told = value.astype(object)
            told[~np.isfinite(value)] = None
            return tuple(told.tolist())
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return tuple(plain(item) for item in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    kind = type(value).__name__
    raise DataError(f"a record holds numbers, text, tuples and mappings, got {kind}")


def canonical(value: object) -> str:
    """The one JSON text of ``value``: sorted keys, no spaces, shortest floats. What gets hashed.

    >>> canonical({"b": 1, "a": (2.0, None)})
    '{"a":[2.0,null],"b":1}'
    """
    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


@dataclass(frozen=True)
class Event:
    """Something a user wants to know, with its reason and evidence.

    >>> Event(row=1, time=2, kind="tuned", signal="Fc1", reason="torque off by 9 %").kind
    'tuned'
    """

    row: int
    """Row at which it became known."""
    time: int
    """Stamp of that row [ns]."""
    kind: str
    """One word: measurement_error, overruled, suspected, abnormal, normal, drift, …"""
    signal: str
    """Channel, group or parameter it is about; empty for the whole twin."""
    reason: str
    """One sentence with its figures."""
    evidence: Mapping[str, Json] = field(default_factory=dict)
    """The figures the decision was taken on."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "evidence", plain(self.evidence))

    def __repr__(self) -> str:
        about = f"{self.kind} {self.signal}".rstrip()
        return f"<Event at row {self.row}, {about}: {self.reason}>"


@dataclass(frozen=True)
class Request:
    """Slow work asked for at a beat; stored before it starts.

    >>> Request(id=1, kind="fit", version=0, row=100, due=100, window=(0, 100)).kind
    'fit'
    """

    id: int
    kind: str
    version: int
    """Version it starts from; an answer to a replaced version is dropped."""
    row: int
    """Row before which it was asked."""
    due: int
    """Row before which a file run waits for the answer; a live run takes the next beat."""
    window: tuple[int, int]
    """Rows [start, stop) it may look at."""
    detail: Mapping[str, Json] = field(default_factory=dict)


@dataclass(frozen=True)
class Answer:
    """The result of a request: an input of the fold, logged with the row that it precedes.

    >>> Answer(id=1, version=0, content={"gain": 1.05}).content["gain"]
    1.05
    """

    id: int
    version: int
    content: Mapping[str, Json]

    def __post_init__(self) -> None:
        object.__setattr__(self, "content", plain(self.content))


Record: TypeAlias = Event | Request | Answer
