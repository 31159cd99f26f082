"""Where slow work runs: in this process, or in a pool of processes.

A twin asks for slow work at a beat (`Request`) and takes the result at a later one (`Answer`). An
engine is given ``prepare``, which turns a request into a job: a call without arguments that holds
all it needs (for a pool it has to be picklable, as ``functools.partial`` of a module's function
is). ``prepare`` runs at once, so a job sees the data as it was when it was asked for.

>>> from functools import partial
>>> from evertwin.fold import Request
>>> def gain(size):
...     return {"gain": 1.0 + size}
>>> engine = InProcess(lambda request: partial(gain, request.id))
>>> engine.submit(Request(id=1, kind="fit", version=0, row=9, due=20, window=(0, 9)))
>>> engine.answers()
(Answer(id=1, version=0, content={'gain': 2.0}),)

A job that raises one of evertwin's own errors answers with it (``{"error": ...}``): a fit that
cannot be made is no reason to stop the machine's twin. Any other exception is a bug and passes.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, NamedTuple, Protocol, TypeAlias, TypeVar, runtime_checkable

from evertwin.errors import EvertwinError, UsageError
from evertwin.fold.records import Answer, Request
from evertwin.types import Json

__all__ = ["Engine", "InProcess", "Job", "Pool", "Prepare"]

Item = TypeVar("Item")
Result = TypeVar("Result")
Job: TypeAlias = Callable[[], Mapping[str, Json]]
Prepare: TypeAlias = Callable[[Request], Job]


@runtime_checkable
class Engine(Protocol):
    """Runs slow work.

    >>> isinstance(InProcess(), Engine)
    True
    """

    def submit(self, request: Request) -> None:
        """Start the work; returns at once or when it is done.

        Raises:
            UsageError: the engine was given no ``prepare``, or the id is already open.
        """
        ...

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        """Answers that have come since the last call, by id; waits for ``until`` if it is open."""
        ...

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """``function`` of every item, in their order; exceptions pass through."""
        ...

    def close(self) -> None:
        """Drop open work and end the processes; a second call does nothing."""
        ...


def _none(request: Request) -> Job:
    raise UsageError(f"request {request.id}: the engine was built without 'prepare'")


def _attempt(job: Job) -> Mapping[str, Json]:
    """The job's result, or its error where that is a value."""
    try:
        return job()
    except EvertwinError as error:
        return {"error": f"{type(error).__name__}: {error}"}


class InProcess:
    """Runs each job when its answer is asked for: simple, and the same in every run.

    >>> InProcess().map(abs, [-1, 2])
    [1, 2]
    """

    def __init__(self, prepare: Prepare = _none) -> None:
        self._prepare = prepare
        self._open: dict[int, tuple[Request, Job]] = {}

    def submit(self, request: Request) -> None:
        """Keep the job."""
        _check_new(request, self._open)
        self._open[request.id] = (request, self._prepare(request))

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        """Run what is open, in the order of the ids."""
        jobs = [self._open.pop(number) for number in sorted(self._open)]
        return tuple(Answer(r.id, r.version, _attempt(job)) for r, job in jobs)

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """``function`` of every item, one after the other."""
        return [function(item) for item in items]

    def close(self) -> None:
        """Drop open work."""
        self._open.clear()


class _Running(NamedTuple):
    """A job in a pool."""

    request: Request
    future: Future[Mapping[str, Json]]
    pool: ProcessPoolExecutor


class Pool:
    """Runs jobs in processes of their own, so that the fold goes on meanwhile.

    A process that dies (killed, out of memory) answers ``{"error": ...}`` for the jobs it had, and
    the pool starts anew; the twin lives on.

    >>> with Pool(workers=1) as pool:
    ...     pool.map(abs, [-1, 2])
    [1, 2]
    """

    def __init__(self, prepare: Prepare = _none, workers: int | None = None) -> None:
        """``workers`` processes, by default one less than there are processors.

        Raises:
            UsageError: less than one worker.
        """
        if workers is not None and workers < 1:
            raise UsageError(f"workers: expected at least 1, got {workers}")
        self._prepare = prepare
        self._workers = workers or max(1, (os.cpu_count() or 2) - 1)
        self._open: dict[int, _Running] = {}
        self._pool: ProcessPoolExecutor | None = None

    def submit(self, request: Request) -> None:
        """Start the job in a process."""
        _check_new(request, self._open)
        job = self._prepare(request)
        pool = self._executor()
        try:
            future = pool.submit(_attempt, job)
        except BrokenProcessPool:
            self._drop(pool)
            pool = self._executor()
            future = pool.submit(_attempt, job)
        self._open[request.id] = _Running(request, future, pool)

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        """Answers of the jobs that are done."""
        if until in self._open:
            wait([self._open[until].future])
        done = sorted(number for number, job in self._open.items() if job.future.done())
        return tuple(self._answer(self._open.pop(number)) for number in done)

    def _answer(self, job: _Running) -> Answer:
        try:
            content = job.future.result()
        except BrokenProcessPool:
            self._drop(job.pool)
            content = {"error": "the process that worked on it died: out of memory, or killed"}
        return Answer(job.request.id, job.request.version, content)

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """``function`` (of a module, picklable) of every item, spread over the processes."""
        return list(self._executor().map(function, items))

    def close(self) -> None:
        """Drop open work and end the processes."""
        self._open.clear()
        if self._pool is not None:
            self._drop(self._pool)

    def _executor(self) -> ProcessPoolExecutor:
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(self._workers, mp_context=context)
        return self._pool

    def _drop(self, pool: ProcessPoolExecutor) -> None:
        """End a pool; a newer one that already took its place goes on."""
        pool.shutdown(wait=True, cancel_futures=True)
        if self._pool is pool:
            self._pool = None

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _check_new(request: Request, known: Mapping[int, Any]) -> None:
    if request.id in known:
        raise UsageError(f"request {request.id}: is already open; every request has its own id")
