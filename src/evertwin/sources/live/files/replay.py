"""A recording replayed as if the machine ran, at any speed.

The recording's own stamps stay; sources of one twin keep step (`Pace`). What a run of the file
would read is what comes: the same guard, the same units, the same tasks.
"""

from __future__ import annotations

import asyncio
import glob
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Gt

from evertwin.errors import DataError
from evertwin.fold import Chunk
from evertwin.settings.kinds import Seconds
from evertwin.settings.notes import Late, expand
from evertwin.sources.live.contract import Around, Health, LiveSettings
from evertwin.sources.live.telling import Telling
from evertwin.sources.recorded import Recorded
from evertwin.sources.spec import SourceSpec

TOGETHER = 0.01
"""Seconds of waiting that are not worth it: samples closer than this are given at once."""
MOST = 256
"""Samples given at once."""


@dataclass(frozen=True)
class ReplaySettings(LiveSettings):
    """``protocol = "replay"``: a recording as if live.

    >>> ReplaySettings("log", "replay", speed=10.0).files
    ()
    """

    files: tuple[Annotated[str, Late()], ...] = ()
    """Recordings or patterns; absent: those of the twin file."""
    speed: Annotated[Seconds, Gt(0.0)] = 1.0
    """Seconds of the recording in a second; ``inf``: as fast as they are read."""

    lies_here: ClassVar[bool] = True


class Replay:
    """The source. Implements `LiveSource`.

    >>> import tempfile
    >>> from evertwin.sources.live.contract import check_live
    >>> from evertwin.sources.spec import ChannelSpec, TimeSpec
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("t,v\\n0,5\\n0.1,6\\n0.2,7\\n")
    >>> spec = SourceSpec("log", {"v": ChannelSpec("v", "cm/s")}, (str(file),), time=TimeSpec("t"))
    >>> settings = ReplaySettings("log", "replay", speed=float("inf"))
    >>> [chunk.v[:, 0].tolist() for chunk in check_live(Replay(settings, spec, Around()))]
    [[0.05, 0.06, 0.07]]
    """

    def __init__(self, settings: ReplaySettings, spec: SourceSpec, around: Around) -> None:
        self.settings = settings
        self.spec = spec
        self.around = around
        self.told = Telling(spec.name, around.twin)
        self.name = spec.name
        self._stored: tuple[int, int] | None = None
        self._closing = asyncio.Event()

    @property
    def health(self) -> Health:
        """See `LiveSource`."""
        return self.told.health

    def open(self) -> None:
        """See `LiveSource`."""
        self._files()
        self.around.pace.join(self.name)

    def resume(self, stamp: int, task: int = 0) -> None:
        """See `LiveSource`."""
        self._stored = task, stamp

    def committed(self, chunk: Chunk) -> None:
        """See `LiveSource`: a file keeps what it has."""

    def close(self) -> None:
        """See `LiveSource`."""
        self._closing.set()

    async def chunks(self) -> AsyncIterator[Chunk]:
        """See `LiveSource`."""
        chunks = iter(Recorded.of(self.spec, self._files()).read())
        closing = asyncio.create_task(self._closing.wait())
        try:
            while (chunk := await asyncio.to_thread(next, chunks, None)) is not None:
                for piece in self._pieces(self._fresh(chunk)):
                    if not await self._due(int(piece.t[0]), closing):
                        return
                    self.told.up()
                    self.told.give(int(piece.t[-1]), len(piece.t))
                    yield piece
        except DataError as error:
            self.told.down(str(error))
            raise
        finally:
            closing.cancel()
            await self.around.pace.leave(self.name)
            self.told.end()

    async def _due(self, stamp: int, closing: asyncio.Task[bool]) -> bool:
        """Waits for the moment; False where the source was closed before."""
        pace, speed = self.around.pace, self.settings.speed
        if pace.base is None or np.isinf(speed):  # what the others do decides, too
            waiting = asyncio.create_task(pace.wait(self.name, stamp, speed))
            await asyncio.wait({waiting, closing}, return_when=asyncio.FIRST_COMPLETED)
            waiting.cancel()
        else:
            await asyncio.wait({closing}, timeout=await pace.until(self.name, stamp, speed))
        return not self._closing.is_set()

    def _pieces(self, chunk: Chunk) -> Iterator[Chunk]:
        """What is due together."""
        speed, start = self.settings.speed, 0
        span = 5 * 10**8 if np.isinf(speed) else max(int(TOGETHER * speed * 1e9), 1)
        while start < len(chunk.t):
            stop = int(np.searchsorted(chunk.t, chunk.t[start] + span))
            stop = min(max(stop, start + 1), start + MOST)
            yield chunk._replace(t=chunk.t[start:stop], v=chunk.v[start:stop])
            start = stop

    def _fresh(self, chunk: Chunk) -> Chunk:
        """Without what is stored."""
        if self._stored is None:
            return chunk
        task, stamp = self._stored
        keep = np.full(len(chunk.t), chunk.task > task) | (
            (chunk.t > stamp) if chunk.task == task else False
        )
        self.told.repeated += int((~keep).sum())
        return chunk._replace(t=chunk.t[keep], v=chunk.v[keep])

    def _files(self) -> tuple[Path, ...]:
        found: list[Path] = []
        for text in self.settings.files or self.spec.files:
            pattern = str(self.around.folder / expand(text))
            hits = sorted(glob.glob(pattern))
            if not hits:
                raise DataError(f"source {self.name!r}: {pattern}: no such file")
            found += map(Path, hits)
        if not found:
            raise DataError(f"source {self.name!r}: no files: name them, here or in the twin file")
        return tuple(found)
