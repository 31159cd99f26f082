"""Samples that wait for a thread, taken together.

>>> async def two() -> list[int]:
...     queue: Gathering[int] = Gathering(Turns(1))
...     for number in (1, 2):
...         queue.put_nowait(number)
...     return await anext(queue.together(lambda: 0.0))
>>> asyncio.run(two())
[1, 2]
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Any, TypeVar

from evertwin.service.twin.process import Turns

T = TypeVar("T")
ENOUGH = 16
"""Pieces of samples that are not kept waiting for more: brokers have 20 on the way at a time."""
TOGETHER = 256
"""Pieces of samples that are stored, or folded, together at most."""
PATIENCE = 10.0
"""Seconds that what waits has at most to be folded when a twin is stopped."""


class Gathering(asyncio.Queue[T]):
    """A queue that is emptied as a whole. See the module for an example."""

    def __init__(self, turns: Turns, most: int = 0) -> None:
        super().__init__(most)
        self._turns = turns
        self._enough = asyncio.Event()
        self._at = min(ENOUGH, most // 2 or 1) if most else ENOUGH

    def _put(self, item: T) -> None:
        super()._put(item)
        if self.qsize() >= self._at:
            self._enough.set()

    async def together(self, pause: Callable[[], float]) -> AsyncIterator[list[T]]:
        """All that waits, again and again, each time when the turn comes, and ``pause`` [s] after
        the last or once they are enough; done with when the next is asked for."""
        last = -math.inf
        while True:
            taken = [await self.get()]
            rest = last + pause() - time.monotonic()
            if rest > 0.0 and self.qsize() < self._at:
                self._enough.clear()
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(rest):
                        await self._enough.wait()
            async with self._turns.one():
                last = time.monotonic()
                while len(taken) < TOGETHER and not self.empty():
                    taken.append(self.get_nowait())
                yield taken
            for _ in taken:
                self.task_done()


async def at_rest(
    reading: Sequence[asyncio.Task[None]], queues: Sequence[asyncio.Queue[Any]],
    working: Sequence[asyncio.Task[None]], patience: float = PATIENCE,
) -> None:  # fmt: skip
    """What came is stored and folded; what takes too long is stored, or comes again."""

    async def drained() -> None:
        await asyncio.wait(reading)
        for queue in queues:
            await queue.join()

    resting = asyncio.create_task(drained())
    first = asyncio.FIRST_COMPLETED
    await asyncio.wait({resting, *working}, timeout=patience, return_when=first)
    for task in (resting, *reading, *working):
        task.cancel()
