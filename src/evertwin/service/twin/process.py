"""What the twins of one process share: readers, machine code, processes, and the one interpreter.

Python runs one thread at a time. Of fifty that want to run each waits for its slice, and so does
the event loop; one after the other they do not, and what came for a twin meanwhile goes through it
together, which costs less.

>>> async def twice(turns: Turns) -> list[int]:
...     found: list[int] = []
...     async def work(number: int) -> None:
...         async with turns.one():
...             await asyncio.sleep(0)
...             found.append(number)
...     await asyncio.gather(work(1), work(2))
...     return found
>>> asyncio.run(twice(Turns(1)))
[1, 2]
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Collection
from dataclasses import dataclass, field

from evertwin.config.spec import TwinSpec
from evertwin.engine import Pool

LONGEST = 0.05
"""Seconds that whoever has the turn keeps others waiting; what takes longer goes on beside them."""
STORING = 4
"""Twins that store at once: they wait for the disk, not for the interpreter."""
SHARE, PAUSE = 0.005, 0.5
"""Seconds for each twin that samples of one are gathered before they are stored together: one alone
hardly waits. And at most."""


class Turns:
    """At most so many work ``at_once``. See the module for an example."""

    def __init__(self, at_once: int) -> None:
        self._free = asyncio.Semaphore(at_once)

    @contextlib.asynccontextmanager
    async def one(self) -> AsyncIterator[None]:
        """A turn, in the order of asking; it ends with the block, or after `LONGEST`."""
        await self._free.acquire()
        turn = contextlib.ExitStack()  # closed twice it gives back once
        turn.callback(self._free.release)
        ends = asyncio.get_running_loop().call_later(LONGEST, turn.close)
        try:
            yield
        finally:
            ends.cancel()
            turn.close()


@dataclass
class Process:
    """What the twins of a process share.

    >>> Process(twins=("arm", "robot")).pause()
    0.01
    """

    twins: Collection[str] = ()
    listeners: set[asyncio.Event] = field(default_factory=set)
    """Are set when any twin says something new."""
    warm: Callable[[TwinSpec], None] | None = None
    """Makes a twin's machine code before it runs, or waits for it."""
    pool: Pool | None = None
    """Processes for the slow work of twins that do not ask for their own."""
    folding: Turns = field(default_factory=lambda: Turns(1))
    storing: Turns = field(default_factory=lambda: Turns(STORING))

    def pause(self) -> float:
        """Seconds between two times that one twin stores."""
        return min(SHARE * len(self.twins), PAUSE)
