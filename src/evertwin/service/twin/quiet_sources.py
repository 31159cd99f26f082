"""Sources that stay away: what time it is on their clock, so that rows need not wait for ever.

The alignment never looks at a clock of this computer, so that a run can be repeated; it waits for a
source until a tick, an input like any sample, says that its ``timeout`` is over.

>>> silence = Silence({"wheels": math.inf, "camera": 2.0}, now=100.0)
>>> silence.came(Chunk("wheels", np.array([7 * 10**9]), np.zeros((1, 1))), now=101.0)
>>> silence.tick(now=101.5) is None        # both may still speak
True
>>> silence.tick(now=103.0).t.tolist()     # nothing from the camera for 3 s
[9000000000]
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import AsyncIterator, Mapping

import numpy as np

from evertwin.config import TwinSpec
from evertwin.fold import Chunk
from evertwin.sync.horizon.horizon import nanoseconds

LEAST, MOST = 0.05, 0.5
"""Seconds from one look to the next."""


def timeouts_of(spec: TwinSpec) -> dict[str, float]:
    """How long rows wait for each source of a twin, and for its scans where they tell its pose."""
    rule = spec.perception
    return {s.name: s.timeout for s in spec.source} | ({rule.scan: rule.timeout} if rule else {})


class Silence:
    """When each source of a twin spoke last. See the module for an example."""

    def __init__(self, timeouts: Mapping[str, float], now: float) -> None:
        """``timeouts``: by source [s], infinite: it is waited for; ``now``: of our clock [s]."""
        self._timeouts = {name: after for name, after in timeouts.items() if after < math.inf}
        self._heard = dict.fromkeys(timeouts, now)
        self._newest: int | None = None
        """Newest stamp of all [ns]."""
        self._at = now
        """When it came."""
        self._task = 0
        self._told = 0
        """Stamp of the newest tick."""
        self._pause = min(max(min(self._timeouts.values(), default=MOST) / 2, LEAST), MOST)
        """Seconds from one look to the next."""

    def came(self, chunk: Chunk, now: float) -> None:
        """Samples of one source; those of arrays are of no row."""
        if chunk.source not in self._heard or len(chunk.t) == 0:
            return
        self._heard[chunk.source] = now
        newest = int(chunk.t.max())
        if self._newest is None or chunk.task > self._task or newest > self._newest:
            if chunk.task > self._task:
                self._told = 0
            self._newest, self._at, self._task = newest, now, chunk.task

    def tick(self, now: float) -> Chunk | None:
        """What tells the alignment how late it is; None where nobody is waited for in vain."""
        late = [after for name, after in self._timeouts.items() if now > self._heard[name] + after]
        # once it lies behind all that waits, another one would say nothing new
        if not late or self._newest is None or self._told > self._newest + nanoseconds(max(late)):
            return None
        self._told = self._newest + nanoseconds(now - self._at)
        return Chunk("", np.array([self._told]), np.zeros((1, 0)), self._task)

    async def ticks(self) -> AsyncIterator[Chunk]:
        """One after the other, as they are due."""
        while self._timeouts:
            await asyncio.sleep(self._pause)
            tick = self.tick(time.monotonic())
            if tick is not None:
                yield tick
