"""Slow work in processes of its own, so that the fold goes on meanwhile.

    submit, map ──jobs──▶ queue ─┬─▶ thread 1 ══ process 1     a thread waits for its process,
                                 └─▶ thread 2 ══ process 2     holds it to its limits, replaces it

Pools that share processes (`Pool.share`) take turns: of what waits, the job goes first whose pool
has had the least of their time; who asks for nothing for a while saves up none of it.

A process that dies, or in which a job takes too long or too much, costs this job alone: the next
one finds a new process. The first process starts with the pool, further ones when all are busy.
"""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Iterable
from concurrent.futures import Future, wait
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

from evertwin.engine.contract import Item, Job, Result, answered, check_new
from evertwin.engine.process import Process, packed
from evertwin.engine.spec import EngineSpec
from evertwin.errors import UsageError
from evertwin.fold.records import Answer, Request


@dataclass
class _Used:
    """What one pool has had of the processes."""

    seconds: float = 0.0
    turn: float = 0.0
    """The same, but never less than that of who was served last when it asked."""


class _Task(NamedTuple):
    """A job on its way."""

    job: bytes
    result: Future[Any]
    whose: _Used


@dataclass
class _Crew:
    """What the threads work with. It does not know the pools, so that these can be let go."""

    start: Callable[[], Process]
    most: int
    """Processes."""
    waiting: list[_Task] = field(default_factory=list)
    threads: list[threading.Thread] = field(default_factory=list)
    working: dict[Future[Any], Process] = field(default_factory=dict)
    unfinished: set[Future[Any]] = field(default_factory=set)
    lock: threading.Condition = field(default_factory=threading.Condition)
    turn: float = 0.0
    """Of the pool that was served last."""
    closed: bool = False

    def put(self, job: Callable[[], Any], whose: _Used) -> Future[Any]:
        """Queues a job, for a process more where all are busy.

        Raises:
            UsageError: the processes have been ended.
        """
        task = _Task(packed(job), Future(), whose)
        with self.lock:
            if self.closed:
                raise UsageError("workers: the pool is closed")
            self.unfinished = {one for one in self.unfinished if not one.done()} | {task.result}
            whose.turn = max(whose.turn, self.turn)
            self.waiting.append(task)
            self.lock.notify()
            if len(self.threads) < min(len(self.unfinished), self.most):
                self.threads.append(threading.Thread(target=self.serve, daemon=True))
                self.threads[-1].start()
        return task.result

    def serve(self) -> None:
        """One thread: a process, one job after the other."""
        process: Process | None = None
        while (task := self._next()) is not None:
            began = time.monotonic()
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
                with self.lock:
                    task.whose.seconds += time.monotonic() - began
                    task.whose.turn += time.monotonic() - began
        if process is not None:
            process.end()

    def _next(self) -> _Task | None:
        """Whose turn it is; None: the processes have been ended."""
        with self.lock:
            while not self.waiting and not self.closed:
                self.lock.wait()
            if self.closed:
                return None
            task = min(self.waiting, key=lambda one: one.whose.turn)  # of several the first
            self.waiting.remove(task)
            self.turn = task.whose.turn
            return task

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
            self.closed = True
            for task in self.waiting:
                task.result.cancel()
            for process in list(self.working.values()):
                process.kill()
            self.lock.notify_all()
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
        self._used = _Used()
        self._open: dict[int, tuple[Request, Future[Any]]] = {}
        self._end: weakref.finalize[[], Pool] | None = None
        if beside is not None:
            self._crew = beside._crew
            return
        first = None if warm is None else packed(warm)
        self._crew = _Crew(partial(Process, rule or EngineSpec(), first), workers)
        self._end = weakref.finalize(self, self._crew.close)
        self._crew.put(dict, self._used)  # the first process starts now

    def share(self) -> Pool:
        """Another pool of the same processes, with requests of its own. Its end is not theirs."""
        return Pool(self.workers, beside=self)

    @property
    def seconds(self) -> float:
        """What its jobs have taken so far, until they were done."""
        return self._used.seconds

    def submit(self, request: Request, job: Job) -> None:
        """Starts the job in a process."""
        check_new(request, self._open)
        self._open[request.id] = (request, self._crew.put(job, self._used))

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
        results = [self._crew.put(partial(function, item), self._used) for item in items]
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
