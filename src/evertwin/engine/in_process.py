"""Slow work in this process: simple, and the same in every run."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from evertwin.engine.contract import Item, Job, Result, answered, check_new
from evertwin.fold.records import Answer, Request


class InProcess:
    """Runs each job when its answer is asked for; nothing limits it.

    >>> InProcess().map(abs, [-1, 2])
    [1, 2]
    """

    workers = 0

    def __init__(self) -> None:
        self._open: dict[int, tuple[Request, Job]] = {}

    def submit(self, request: Request, job: Job) -> None:
        """Keeps the job."""
        check_new(request, self._open)
        self._open[request.id] = (request, job)

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        """Runs what is open, in the order of the ids."""
        jobs = [self._open.pop(number) for number in sorted(self._open)]
        return tuple(answered(request, job) for request, job in jobs)

    def drop(self, number: int) -> None:
        """Forgets the job."""
        self._open.pop(number, None)

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """``function`` of every item, one after the other."""
        return [function(item) for item in items]

    def close(self) -> None:
        """Drops open work."""
        self._open.clear()
