"""What waits in a queue, taken together.

>>> queue = asyncio.Queue()
>>> for number in (1, 2): queue.put_nowait(number)
>>> asyncio.run(anext(together(queue)))
[1, 2]
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import TypeVar

T = TypeVar("T")
TOGETHER = 256
"""Pieces of samples that are stored, or folded, together at most."""


async def together(queue: asyncio.Queue[T]) -> AsyncIterator[list[T]]:
    """All that waits in a queue, again and again; done with when the next is asked for."""
    while True:
        taken = [await queue.get()]
        while len(taken) < TOGETHER and not queue.empty():
            taken.append(queue.get_nowait())
        yield taken
        for _ in taken:
            queue.task_done()
