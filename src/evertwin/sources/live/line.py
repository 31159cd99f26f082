"""A live source over a line that breaks: connects, reads, and connects again.

A protocol says only what it is to be connected (`Line.session`). Waiting between attempts grows
(`Backoff`); it is short again once a sample came. The line is read by a task of its own behind a
bounded queue: a slow reader makes the machine's samples wait where the protocol can (a broker's
queue, a file), and is counted as a loss where it cannot (`Polled` protocols).
"""

from __future__ import annotations

import asyncio
import time
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator
from contextlib import suppress

from evertwin.backoff import Backoff
from evertwin.errors import DataError, reason_of
from evertwin.fold import Chunk
from evertwin.sources.live.arrays import decoder_of
from evertwin.sources.live.contract import Around, Health, LiveSettings
from evertwin.sources.live.decode import Columns
from evertwin.sources.live.telling import Telling
from evertwin.sources.spec import ArraySpec, SourceSpec

DOWN = "the line was down"
WAITING = 256
"""Chunks that wait for the reader."""


class LineDown(Exception):
    """The line is gone, for a reason.

    >>> str(LineDown("no answer within 1 s"))
    'no answer within 1 s'
    """


class Line(ABC):
    """Base of the sources with a connection. Implements `LiveSource`.

    >>> Line.__abstractmethods__
    frozenset({'session'})
    """

    def __init__(
        self, settings: LiveSettings, spec: SourceSpec | ArraySpec, around: Around, *,
        arrives: bool = True,
    ) -> None:  # fmt: skip
        self.told = Telling(spec.name, around.twin)
        self.decoder = decoder_of(spec, self.told, settings, arrives=arrives)
        self.backoff = Backoff()
        self._queue: asyncio.Queue[Chunk | None] = asyncio.Queue(WAITING)
        self._reading: asyncio.Task[None] | None = None
        self._closed = False
        self._left: float | None = None
        """When the line was up last."""

    @property
    def name(self) -> str:
        """See `LiveSource`."""
        return self.told.name

    @property
    def health(self) -> Health:
        """See `LiveSource`."""
        return self.told.health

    def open(self) -> None:
        """See `LiveSource`."""
        self.decoder.check()

    def resume(self, stamp: int, task: int = 0) -> None:
        """See `LiveSource`."""
        self.decoder.resume(stamp, task)

    def go_on(self, clock: tuple[int, ...]) -> None:
        """With the clock that was kept (`Chunk.clock`); after `resume`."""
        self.decoder.go_on(clock)

    def committed(self, chunk: Chunk) -> None:  # noqa: B027  most machines keep nothing
        """See `LiveSource`."""

    def close(self) -> None:
        """See `LiveSource`."""
        self._closed = True
        if self._reading is not None:
            self._reading.cancel()

    async def chunks(self) -> AsyncIterator[Chunk]:
        """See `LiveSource`."""
        if not self._closed:
            self._reading = asyncio.create_task(self._sessions(), name=f"evertwin {self.name}")
        try:
            while not self._closed:
                chunk = await self._next()
                if chunk is None:
                    return
                yield chunk
        finally:
            self.close()
            if self._reading is not None:
                with suppress(asyncio.CancelledError):
                    await self._reading
            self.told.end()

    async def _next(self) -> Chunk | None:
        """What waits, or None once the line has ended."""
        assert self._reading is not None
        if not self._queue.empty():
            return self._queue.get_nowait()
        getting = asyncio.ensure_future(self._queue.get())
        try:
            await asyncio.wait({getting, self._reading}, return_when=asyncio.FIRST_COMPLETED)
            if getting.done():
                return getting.result()
            if not self._reading.cancelled():
                self._reading.result()
            return None
        finally:
            getting.cancel()

    @abstractmethod
    def session(self) -> AsyncIterator[Columns]:
        """One connection: connects, yields samples, lets go when it is closed.

        Raises:
            LineDown, OSError, TimeoutError: the line is gone; another session follows.
        """

    def decode(self, columns: Columns) -> list[Chunk]:
        """What goes out on one more sample."""
        return self.decoder.chunks(columns)

    def lost_since(self, period: float) -> None:
        """Counts what a machine that keeps nothing said while the line was down."""
        if self._left is not None:
            away, self._left = time.monotonic() - self._left, None
            if away >= period:
                self.told.lose(DOWN, int(away / period))

    async def _sessions(self) -> None:
        while True:
            try:
                await self._one_session()
                return await self._queue.put(None)
            except (LineDown, OSError, TimeoutError, DataError) as error:
                self.told.down(reason_of(error))
            await asyncio.sleep(self.backoff.next())

    async def _one_session(self) -> None:
        session = self.session()
        try:
            async for columns in session:
                self.told.up()
                self.backoff.reset()
                for chunk in self.decode(columns):
                    await self._queue.put(chunk)
        finally:
            if self.told.state == "up":
                self._left = time.monotonic()
            await session.aclose()  # type: ignore[attr-defined]
