"""Slow work in processes of its own, so that the fold goes on meanwhile.

    submit, map ──jobs──▶ queue ─┬─▶ thread 1 ══ process 1     a thread waits for its process,
                                 └─▶ thread 2 ══ process 2     holds it to its limits, replaces it

A process that dies, or in which a job takes too long or too much, costs this job alone: the next
one finds a new process. The first process starts with the pool, further ones when all are busy.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Iterable
from concurrent.futures import Future, wait
from dataclasses import dataclass, field
from functools import partial
from queue import SimpleQueue
from typing import Any, NamedTuple

from evertwin.engine.contract import Item, Job, Result, answered, check_new
from evertwin.engine.process import Process, packed
from evertwin.engine.spec import EngineSpec
from evertwin.errors import UsageError
from evertwin.fold.records import Answer, Request


class _Task(NamedTuple):
    """A job on its way."""

    job: bytes
    result: Future[Any]


@dataclass
class _Crew:
    """What the threads work with. It does not know the pools, so that these can be let go."""

    start: Callable[[], Process]
    most: int
    """Processes."""
    tasks: SimpleQueue[_Task | None] = field(default_factory=SimpleQueue)
    threads: list[threading.Thread] = field(default_factory=list)
    working: dict[Future[Any], Process] = field(default_factory=dict)
    unfinished: set[Future[Any]] = field(default_factory=set)
    lock: threading.Lock = field(default_factory=threading.Lock)
    closed: bool = False

    def put(self, job: Callable[[], Any]) -> Future[Any]:
        """Queues a job, for a process more where all are busy.

        Raises:
            UsageError: the processes have been ended.
        """
        task = _Task(packed(job), Future())
        with self.lock:
            if self.closed:
                raise UsageError("workers: the pool is closed")
            self.unfinished = {one for one in self.unfinished if not one.done()} | {task.result}
            self.tasks.put(task)
            if len(self.threads) < min(len(self.unfinished), self.most):
                self.threads.append(threading.Thread(target=self.serve, daemon=True))
                self.threads[-1].start()
        return task.result

    def serve(self) -> None:
        """One thread: a process, one job after the other."""
        process: Process | None = None
        while (task := self.tasks.get()) is not None:
            if self.closed:
                task.result.cancel()
                continue
            try:
                if process is None or not process.alive:
                    process = self.start()
                if self._taken(task.result, process):
                    task.result.set_result(process.run(task.job))
            except Exception as error:  # noqa: BLE001  (raised again where the result is taken)
                if not task.result.cancelled():
                    task.result.set_exception(error)
            finally:
                self.working.pop(task.result, None)
        if process is not None:
            process.end()

    def _taken(self, result: Future[Any], process: Process) -> bool:
        """Is it wanted still? From here on only the end of its process stops it."""
        with self.lock:
            wanted = not self.closed and result.set_running_or_notify_cancel()
            if wanted:
                self.working[result] = process
        return wanted

    def stop(self, result: Future[Any]) -> None:
        """Ends the work on one result."""
        with self.lock:
            process = None if result.cancel() else self.working.get(result)
        if process is not None:
            process.kill()

    def close(self) -> None:
        """Ends all work, then the processes."""
        with self.lock:
            self.closed = True  # what is queued is passed over
            for process in list(self.working.values()):
                process.kill()
        for _ in self.threads:
            self.tasks.put(None)
        for thread in self.threads:
            # whoever lets go of the pool may be one of its threads, on behalf of the collector
            if thread is not threading.current_thread():
                thread.join()


class Pool:
    """Runs jobs in processes, each job within limits.

    >>> with Pool(workers=1) as pool:
    ...     pool.map(abs, [-1, 2])
    [1, 2]
    """

    def __init__(
        self, workers: int, rule: EngineSpec | None = None,
        warm: Callable[[], object] | None = None, *, beside: Pool | None = None,
    ) -> None:  # fmt: skip
        """At most ``workers`` processes; each calls ``warm`` when it starts, free of limits.
        ``beside``: none of its own, but those of another pool (`share`).

        Raises:
            UsageError: less than one worker.
        """
        if workers < 1:
            raise UsageError(f"workers: expected at least 1, got {workers}")
        self.workers = workers
        self._crew: _Crew
        self._open: dict[int, tuple[Request, Future[Any]]] = {}
        self._end: weakref.finalize[[], Pool] | None = None
        if beside is not None:
            self._crew = beside._crew
            return
        first = None if warm is None else packed(warm)
        self._crew = _Crew(partial(Process, rule or EngineSpec(), first), workers)
        self._end = weakref.finalize(self, self._crew.close)
        self._crew.put(dict)  # the first process starts now

    def share(self) -> Pool:
        """Another pool of the same processes, with requests of its own. Its end is not theirs."""
        return Pool(self.workers, beside=self)

    def submit(self, request: Request, job: Job) -> None:
        """Starts the job in a process."""
        check_new(request, self._open)
        self._open[request.id] = (request, self._crew.put(job))

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        """Answers of the jobs that are done."""
        if until in self._open:
            wait([self._open[until][1]])
        done = sorted(number for number, (_, result) in self._open.items() if result.done())
        taken = [self._open.pop(number) for number in done]
        return tuple(answered(request, result.result) for request, result in taken)

    def drop(self, number: int) -> None:
        """Ends the work; a process that is busy with it is replaced."""
        if number in self._open:
            self._crew.stop(self._open.pop(number)[1])

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """``function`` (of a module, picklable) of every item, spread over the processes.

        Raises:
            WorkLost: a process died, or a job took more than it may.
        """
        results = [self._crew.put(partial(function, item)) for item in items]
        try:
            return [result.result() for result in results]
        finally:
            for result in results:
                self._crew.stop(result)

    def close(self) -> None:
        """Drops open work and ends its own processes."""
        for number in tuple(self._open):
            self.drop(number)
        if self._end is not None:
            self._end()

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
