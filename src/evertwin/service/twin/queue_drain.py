"""What waits in a queue, taken together.

>>> queue = asyncio.Queue()
>>> for number in (1, 2): queue.put_nowait(number)
>>> asyncio.run(anext(together(queue)))
[1, 2]
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from typing import Any, TypeVar

T = TypeVar("T")
TOGETHER = 256
"""Pieces of samples that are stored, or folded, together at most."""
PATIENCE = 10.0
"""Seconds that what waits has at most to be folded when a twin is stopped."""


async def together(queue: asyncio.Queue[T]) -> AsyncIterator[list[T]]:
    """All that waits in a queue, again and again; done with when the next is asked for."""
    while True:
        taken = [await queue.get()]
        while len(taken) < TOGETHER and not queue.empty():
            taken.append(queue.get_nowait())
        yield taken
        for _ in taken:
            queue.task_done()


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
