"""One thread for one twin, whose work may never end.

A thread cannot be ended from outside. This one keeps neither the process nor whoever waits from
going on: it is a daemon, and says where it is.

>>> lane = Lane("twin arm")
>>> lane.submit(pow, 2, 5).result(), lane.shutdown()
(32, None)
"""

from __future__ import annotations

import asyncio
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from queue import SimpleQueue
from types import FrameType
from typing import Any, ParamSpec, TypeVar

T = TypeVar("T")
P = ParamSpec("P")
SLOW = ("numba", "llvmlite", "evertwin.refit", "evertwin.loop.slow_work")
"""Packages whose work may take minutes: machine code, and fits in the twin's own thread."""


class Lane(Executor):
    """The thread. See the module for an example."""

    def __init__(self, name: str) -> None:
        self.busy_since: float | None = None
        """When it took up what it is at (monotonic) [s]."""
        self.worked = 0.0
        """Seconds of work in it."""
        self._work: SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """See `Executor`."""
        future: Future[T] = Future()
        self._work.put((future, lambda: fn(*args, **kwargs)))
        return future

    async def do(self, work: Callable[[], T]) -> T:
        """Something in the thread."""
        return await asyncio.get_running_loop().run_in_executor(self, work)

    async def ends(
        self, future: Future[Any], step: float, longest: float, stuck: Callable[[], bool]
    ) -> bool:
        """Does it come to an end? It is waited for in steps, until what is before it is ``stuck``,
        and for ``longest`` [s]."""
        until = time.monotonic() + longest
        while not future.done() and time.monotonic() < until:
            await asyncio.wait({asyncio.wrap_future(future)}, timeout=step)
            if stuck() and not (future.running() or self.slow):
                break
        return future.done()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """See `Executor`; it is never waited for."""
        self._work.put(None)

    @property
    def slow(self) -> bool:
        """Is it at what may take minutes?"""
        names = (frame.f_globals.get("__name__", "") for frame in self._frames())
        return any(name == one or name.startswith(f"{one}.") for name in names for one in SLOW)

    @property
    def place(self) -> str:
        """Line of Python that it is at."""
        frame = next(self._frames(), None)
        if frame is None:
            return ""
        return f"{frame.f_code.co_filename}:{frame.f_lineno} ({frame.f_code.co_name})"

    def _frames(self) -> Iterator[FrameType]:
        frame = sys._current_frames().get(self._thread.ident or 0)
        while frame is not None:
            yield frame
            frame = frame.f_back

    def _run(self) -> None:
        while (taken := self._work.get()) is not None:
            future, work = taken
            del taken
            if not future.set_running_or_notify_cancel():
                continue
            self.busy_since, began = time.monotonic(), time.thread_time()
            try:
                result = work()
            except BaseException as error:  # noqa: BLE001  (whoever asked hears of it)
                future.set_exception(error)
            else:
                future.set_result(result)
                del result
            finally:
                self.worked += time.thread_time() - began
                self.busy_since = None
            del future, work
