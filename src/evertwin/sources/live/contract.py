"""The contract of a live source, what it tells of itself, and its public checker.

A live source connects by itself, again and again: whoever reads it never sees that a line was cut,
only that samples stay away and what `Health` says. Third parties add theirs under the entry points
``evertwin.sources``: a class with ``settings`` (its `LiveSettings`) whose objects are sources.

>>> Health().state, Health(lost={"gap": 2}).losses
('connecting', 2)
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, Literal, Protocol, TypeAlias

import numpy as np

from evertwin.errors import LawBroken
from evertwin.fold import Chunk
from evertwin.settings.kinds import Duration
from evertwin.settings.notes import expand
from evertwin.settings.section import Section
from evertwin.sources.contract import check_form
from evertwin.sources.live.pace import Pace
from evertwin.types import Json

State: TypeAlias = Literal["connecting", "up", "down", "ended"]
BLOCKS = 0.25
"""Seconds from which on a call counts as one that blocks."""


@dataclass(frozen=True)
class LiveSettings(Section):
    """``[[twin.source]]``: what every live source is told; each protocol adds its own.

    >>> LiveSettings("controller", "replay").stamp
    'column'
    """

    source: str
    """Name of the ``[[source]]`` in the twin file."""
    protocol: str
    """How the machine speaks: modbus, mqtt, opcua, file, replay, or what another package adds."""
    stamp: Literal["column", "arrival"] = "column"
    """Stamps come from the column of time that the twin file names, or from the arrival here."""
    pause: Duration | None = None
    """A silence of so long opens a new task."""
    every: Duration | None = None
    """A new task opens after so long."""

    lies_here: ClassVar[bool] = False
    """Is it read from this machine itself, so that no other one can?"""


UNCERTAIN = ": uncertain"
"""Behind a column's name: what is noted of its values that the machine calls so."""


@dataclass(frozen=True)
class Health:
    """How a live source is. See the module for an example."""

    state: State = "connecting"
    since: float = 0.0
    """Second (Unix) from which on the state holds."""
    newest: int | None = None
    """Newest stamp that was given [ns]."""
    received: int = 0
    """Samples that were given."""
    rejected: Mapping[str, int] = field(default_factory=dict)
    """Samples that were kept out, by reason."""
    repeated: int = 0
    """Samples that had come before."""
    lost: Mapping[str, int] = field(default_factory=dict)
    """Samples of which is known that they never came, by cause."""
    noted: Mapping[str, int] = field(default_factory=dict)
    """What was remarkable in samples that were given, such as values that a server calls
    uncertain."""
    reconnects: int = 0
    reason: str = ""
    """The newest thing that went wrong."""
    passed: bool = False
    """Is that over: was it the line, which is up again?"""
    hint: str = ""
    """What in the map looks wrong, and what would be right."""

    @property
    def losses(self) -> int:
        """Samples lost, of all causes."""
        return sum(self.lost.values())

    @property
    def uncertain(self) -> dict[str, float]:
        """Share of the samples of each column that the machine itself calls uncertain.

        >>> Health(received=8, noted={"x: uncertain": 2, "came late": 1}).uncertain
        {'x': 0.25}
        """
        return {
            what.removesuffix(UNCERTAIN): min(count / max(self.received, 1), 1.0)
            for what, count in self.noted.items() if what.endswith(UNCERTAIN)
        }  # fmt: skip

    def after(self, before: Health | None) -> Health:
        """The same, counted on from what the source said before it was opened anew.

        >>> Health(received=2, lost={"gap": 1}).after(Health(received=3, lost={"gap": 2})).lost
        {'gap': 3}
        """
        if before is None:
            return self
        kept, lost, noted = (
            {key: old.get(key, 0) + new.get(key, 0) for key in (*old, *new)}
            for old, new in (
                (before.rejected, self.rejected), (before.lost, self.lost),
                (before.noted, self.noted),
            )
        )  # fmt: skip
        return replace(
            self, received=before.received + self.received, rejected=kept, lost=lost, noted=noted,
            repeated=before.repeated + self.repeated, newest=self.newest or before.newest,
            reconnects=before.reconnects + self.reconnects,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Json]:
        """Plain content; no reason where what went wrong is over."""
        return {
            "state": self.state, "since": self.since, "newest": self.newest,
            "received": self.received, "rejected": dict(self.rejected), "repeated": self.repeated,
            "lost": dict(self.lost), "noted": dict(self.noted), "reconnects": self.reconnects,
            "reason": "" if self.passed else self.reason, "hint": self.hint,
            "uncertain": self.uncertain,
        }  # fmt: skip


class LiveSource(Protocol):
    """Samples of a running machine. All calls from one thread, the one of the event loop.

    >>> hasattr(LiveSource, "committed")
    True
    """

    @property
    def name(self) -> str:
        """Name of the source in the twin file."""
        ...

    @property
    def health(self) -> Health:
        """How it is now."""
        ...

    def open(self) -> None:
        """Check what can be checked without the machine; never blocks.

        Raises:
            UsageError: the settings and the twin file do not fit.
            MissingExtra: the library of the protocol is not installed.
        """
        ...

    def resume(self, stamp: int, task: int = 0) -> None:
        """The newest stamp [ns] and task that the store has: nothing comes twice. Before the first
        chunk."""
        ...

    def chunks(self) -> AsyncIterator[Chunk]:
        """The samples in SI. Connects, and connects again, until the source ends or is closed."""
        ...

    def committed(self, chunk: Chunk) -> None:
        """The chunk is durable: the machine may forget it."""
        ...

    def close(self) -> None:
        """Let go; `chunks` ends. May be called again."""
        ...


@dataclass(frozen=True)
class Around:
    """What the sources of one twin share.

    >>> Around().folder.name
    ''
    """

    folder: Path = Path()
    """What relative paths in their settings are relative to."""
    pace: Pace = field(default_factory=Pace)
    """Replayed recordings keep step by it."""
    twin: str = ""
    """Its name, for the log."""

    def file(self, text: str | None) -> Path | None:
        """A file that settings name, by its path here."""
        return None if text is None else self.folder / expand(text)


def check_live(source: LiveSource, limit: int = 100, seconds: float = 10.0) -> list[Chunk]:
    """Checks the laws of a live source on what it gives: up to ``limit`` chunks.

    Laws: *open* (does not block), *rows* (n ≥ 1 in every chunk), *types* (int64 stamps, float64
    values), *one source* (name and width do not change), *once* (no stamp twice), *tasks* (never go
    back), *told* (health counts what came and has a state that fits), *close* (ends `chunks` soon,
    and may be called twice).

    Returns:
        What it gave.

    Raises:
        LawBroken: names the law.
    """
    return asyncio.run(_watched(source, limit, seconds))


async def _watched(source: LiveSource, limit: int, seconds: float) -> list[Chunk]:
    began = time.perf_counter()
    source.open()
    if time.perf_counter() - began > BLOCKS:
        raise LawBroken(f"open: took {time.perf_counter() - began:.2f} s")
    given: list[Chunk] = []

    async def read() -> None:
        async for chunk in source.chunks():
            _check(source.name, chunk, given)
            given.append(chunk)
            source.committed(chunk)
            if len(given) == limit:
                source.close()

    reading = asyncio.create_task(read())
    await asyncio.wait({reading}, timeout=seconds)
    source.close()
    source.close()
    done, _ = await asyncio.wait({reading}, timeout=5.0)
    if not done:
        reading.cancel()
        raise LawBroken("close: chunks went on for 5 s after it")
    reading.result()
    count, health = sum(len(chunk.t) for chunk in given), source.health
    if health.received < count or health.state != "ended":
        raise LawBroken(f"told: {count} samples came, health says {health}")
    return given


def _check(name: str, chunk: Chunk, before: list[Chunk]) -> None:
    number = len(before)
    check_form(number, chunk, name, before[0] if before else chunk)
    if before and chunk.task < before[-1].task:
        raise LawBroken(f"tasks: chunk {number} goes back to task {chunk.task}")
    stamps = np.concatenate([*(c.t for c in before if c.task == chunk.task), chunk.t])
    if len(np.unique(stamps)) != len(stamps):
        raise LawBroken(f"once: a stamp of chunk {number} came before")
