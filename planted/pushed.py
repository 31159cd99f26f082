"""A recording, and the same samples pushed: what has to come out alike, and when it was known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from evertwin import RunResult, Twin, TwinSpec
from evertwin.fold import Chunk
from evertwin.rows import Data, Feed
from evertwin.rows.alignment import Alignment
from evertwin.rows.rate import ENOUGH, measured
from planted.twins import opened


class Compared(NamedTuple):
    """One recording, read and pushed.

    >>> Compared._fields[0]
    'result'
    """

    result: RunResult
    """Of the run that was pushed."""
    different: tuple[str, ...]
    """Columns of the rows, and parts of the log, that are not the same in every bit."""
    entries: int
    """Of the log."""
    pieces: int
    late: int
    """Most rows that had come before something was known, less the row at which it stands."""
    beat: int
    delay: int
    """What the twin file declares, in rows."""


def compared(spec: TwinSpec, data: Data, rng: np.random.Generator) -> Compared:
    """Runs a twin beside a recording, and pushes the samples of it to another, in random pieces."""
    with Twin(spec) as twin:
        feed = Feed(spec, twin.model)
        rate, _ = measured(feed.stream(data))
        recorded, expected = twin.run(data), _log(twin)
    trace, brings = recorded.trace, feed.brings(data)
    with Twin(spec) as twin:
        beat = twin.setup.at(rate).beat.every
        delay = Alignment.of(spec, twin.model, brings).delay
        # until stamps have told the rate, times are no rows: the first of them are judged together
        together = ENOUGH if twin.setup.times and spec.clock.rate is None else 0
        late, known, pieces, newest = 0, 0, 0, dict.fromkeys([one.name for one in brings], _NEVER)
        for piece in _pieces(feed.chunks(data), rng, max(beat // 4, 2)):
            twin.push(_as_pushed(spec, piece, data))
            pieces += 1
            newest[piece.source] = (piece.task, int(piece.t[-1]))
            entries = twin.store.entries(known)
            known += len(entries)
            rows = [e.row for e in entries if e.run and e.row]
            if rows:
                at = max(min(rows), together)
                late = max(late, _come(trace, min(newest.values())) - at)
        result, found = twin.finish(), _log(twin)
    unequal = [f"row: {n}" for n in trace if not _same(trace[n], result.trace.get(n))]
    unequal += [f"log: {a} | {b}" for a, b in zip(expected, found) if a != b][:1]
    if len(expected) != len(found):
        unequal.append(f"log: {len(expected)} entries, pushed {len(found)}")
    return Compared(result, tuple(unequal), len(found), pieces, late, beat, delay)


def tank(n: int) -> Mapping[str, np.ndarray]:
    """The tank of `twins/template.toml`, wider than it says, filled from time to time, at 1 Hz."""
    rng = np.random.default_rng(1)
    pump = np.repeat(rng.uniform(0.0, 4e-3, n // 100), 100)
    with opened("template") as twin:
        values = twin.model.parameters.values * (1.3, 1.0)
        level = twin.model.simulate(np.array([0.3]), pump[:, None], np.ones(n), values)[1]
    later = np.r_[pump[1:], pump[-1]]  # a command holds from its stamp on
    return {"t": np.arange(n) * 1.0, "pump": later,
            "level": level[:, 0] + rng.normal(0.0, 0.002, n)}  # fmt: skip


_NEVER = (-1, 0)


def _pieces(chunks: Iterator[Chunk], rng: np.random.Generator, most: int) -> Iterator[Chunk]:
    """The samples one by one, and by several up to ``most``, as it comes."""
    for chunk in chunks:
        at = 0
        while at < len(chunk.t):
            n = 1 if rng.random() < 0.5 else int(rng.integers(2, most + 1))
            yield chunk._replace(t=chunk.t[at : at + n], v=chunk.v[at : at + n])
            at += n


def _as_pushed(spec: TwinSpec, piece: Chunk, data: Data) -> Chunk | Mapping[str, Any]:
    """Samples of a source; columns by name where the recording is one."""
    if not isinstance(data, Mapping):
        return piece
    names = [name for name in data if name != "t"]
    return {"t": piece.t * 1e-9, **dict(zip(names, piece.v.T, strict=True))}


def _come(trace: Mapping[str, np.ndarray], newest: tuple[int, int]) -> int:
    """Rows up to a task and a stamp."""
    inside = (trace["task"] == newest[0]) & (trace["t"] <= newest[1])
    return int(np.count_nonzero(trace["task"] < newest[0]) + np.count_nonzero(inside))


def _log(twin: Twin) -> list[tuple[int, str, int, str]]:
    return [
        entry[1:5]
        for entry in twin.store.entries()
        if not (entry.kind == "event" and '"kind":"started"' in entry.content)
    ]


def _same(a: np.ndarray, b: np.ndarray | None) -> bool:
    floats = a.dtype.kind == "f"
    return b is not None and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=floats)
