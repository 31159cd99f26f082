"""Group commit: jobs are written in their order, all that wait in one transaction.

Nobody waits for a disk who does not ask to: `Writer.put` returns at once, `Writer.flush` when
everything put before is durable. What a failed write held back is never written later: after an
error nothing more is taken.

>>> class Paper:
...     def write(self, jobs): self.text = jobs
>>> paper = Paper()
>>> writer = Writer(paper, threaded=False)
>>> writer.put("a", size=1)
>>> writer.flush()
>>> paper.text
['a']
"""

from __future__ import annotations

import threading
from typing import Generic, Protocol, TypeVar

from evertwin.errors import StoreError

T = TypeVar("T")
SOME = 4096
"""Bytes that wait at most where there is no thread; a job counts as some at least."""
LEAST = SOME // 16
LINGER = 0.005
"""Seconds in which jobs that nobody waits for are gathered."""
ROOM = 64 << 20
"""Bytes that may wait; beyond, `Writer.put` waits too."""


class Paper(Protocol[T]):
    """What is written on."""

    def write(self, jobs: list[T]) -> None:
        """Makes jobs durable, whole or not at all.

        Raises:
            StoreError: it could not.
        """
        ...


class Writer(Generic[T]):
    """Writes jobs on a thread of its own, which starts with the first job.

    >>> class Paper:
    ...     def write(self, jobs): print(jobs)
    >>> writer = Writer(Paper(), threaded=True)
    >>> writer.put("a", size=1); writer.flush(); writer.close()
    ['a']
    """

    def __init__(self, paper: Paper[T], *, threaded: bool) -> None:
        """Not ``threaded``: who puts or flushes writes what waits, some jobs at once."""
        self._paper = paper
        self._threaded = threaded
        self._waiting: list[T] = []
        self._room = 0
        self._taken = self._written = self._asked = 0
        self._ends = False
        self._failed: StoreError | None = None
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def put(self, job: T, size: int) -> None:
        """Takes a job of ``size`` bytes; waits where too much waits already.

        Raises:
            StoreError: an earlier job could not be written.
        """
        with self._changed:
            if not self._threaded:
                self._waiting.append(job)
                self._room += max(size, LEAST)
                return self._write(SOME)
            self._changed.wait_for(lambda: self._room < ROOM or self._failed is not None)
            self.check()
            self._waiting.append(job)
            self._room += size
            self._taken += 1
            if len(self._waiting) == 1 or self._room >= ROOM:
                self._changed.notify_all()
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="store", daemon=True)
                self._thread.start()

    def flush(self) -> None:
        """Returns when everything is durable that was put before.

        Raises:
            StoreError: something could not be written.
        """
        with self._changed:
            if not self._threaded:
                return self._write(1)
            self._asked = here = self._taken
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._written >= here or self._failed is not None)
            self.check()

    def _write(self, least: int) -> None:
        """Writes what waits, here, if it is at least so much."""
        self.check()
        if self._room >= least:
            jobs, self._waiting, self._room = self._waiting, [], 0
            self._failed = self._attempt(jobs)
            self.check()

    def close(self) -> None:
        """Writes what waits, and ends the thread; a second call does nothing."""
        with self._changed:
            self._ends = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join()

    def check(self) -> None:
        """Has everything been written so far?

        Raises:
            StoreError: something could not be.
        """
        if self._failed is not None:
            raise type(self._failed)(str(self._failed)) from self._failed

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._waiting) or self._ends)
                if not self._waiting:
                    return
                self._changed.wait_for(self._pressing, LINGER)
                jobs, self._waiting, size = self._waiting, [], self._room
            failed = self._attempt(jobs)
            with self._changed:
                self._written, self._room = self._written + len(jobs), self._room - size
                if failed is not None:
                    self._failed, self._waiting = failed, []
                self._changed.notify_all()

    def _pressing(self) -> bool:
        return self._asked > self._written or self._ends or self._room >= ROOM

    def _attempt(self, jobs: list[T]) -> StoreError | None:
        try:
            self._paper.write(jobs)
        except StoreError as error:
            return error
        return None
