"""One clock for the replayed sources of a twin.

Recordings that were made together are given together: each sample is due when its stamp says so,
counted from the first stamp of all, at any speed.
"""

from __future__ import annotations

import asyncio
import time

import numpy as np

AHEAD = 10**9
"""How far [ns] a source runs ahead of the others where all go as fast as they can."""


class Pace:
    """Keeps the replayed sources of one twin together: one clock for all of them.

    >>> Pace().base is None
    True
    """

    def __init__(self) -> None:
        self.next: dict[str, int | None] = {}
        """Stamp that each source gives next; None while it is not known."""
        self.base: tuple[int, float] | None = None
        """First stamp of all, and when it was due (monotonic)."""
        self.moved = asyncio.Condition()

    def join(self, name: str) -> None:
        """A source will take part."""
        self.next.setdefault(name, None)

    async def leave(self, name: str) -> None:
        """A source has ended."""
        async with self.moved:
            self.next.pop(name, None)
            self.moved.notify_all()

    async def wait(self, name: str, stamp: int, speed: float) -> None:
        """Until the sample of a source is due.

        Args:
            name: the source.
            stamp: its next stamp [ns].
            speed: seconds of the recording in a second; infinite: as fast as the others follow.
        """
        async with self.moved:
            self.next[name] = stamp
            self.moved.notify_all()
            await self.moved.wait_for(lambda: None not in self.next.values())
            if self.base is None:
                first = min(s for s in self.next.values() if s is not None)
                self.base = first, time.monotonic()
            if np.isinf(speed):
                await self.moved.wait_for(lambda: stamp <= self._slowest() + AHEAD)
                return
        await asyncio.sleep(await self.until(name, stamp, speed))

    async def until(self, name: str, stamp: int, speed: float) -> float:
        """Seconds until the sample of a source is due, once the first stamp of all is known."""
        assert self.base is not None
        async with self.moved:
            self.next[name] = stamp
            self.moved.notify_all()
        first, began = self.base
        return max(began + (stamp - first) * 1e-9 / speed - time.monotonic(), 0.0)

    def _slowest(self) -> int:
        return min(self.next.values(), key=lambda s: -(2**63) if s is None else s) or 0
