"""What a twin asks of the place where its slow work runs.

A beat asks for slow work (`Request`) and a later one takes what came of it (`Answer`). The job goes
along with the request: a call without arguments that holds all it needs, as ``functools.partial``
of a module's function does, so it sees the data as it was when it was asked for.

>>> from functools import partial
>>> from evertwin.engine import Engine, InProcess
>>> def gain(size):
...     return {"gain": 1.0 + size}
>>> engine = InProcess()
>>> isinstance(engine, Engine)
True
>>> asked = Request(id=1, kind="fit", version=0, row=9, due=20, window=(0, 9))
>>> engine.submit(asked, partial(gain, 1))
>>> engine.answers()
(Answer(id=1, version=0, content={'gain': 2.0}),)

A job that raises one of evertwin's own errors answers with it (``{"error": ...}``): a fit that
cannot be made is no reason to stop the machine's twin. Any other exception is a bug and passes.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from typing import Protocol, TypeAlias, TypeVar, runtime_checkable

from evertwin.errors import EvertwinError, UsageError
from evertwin.fold.records import Answer, Request
from evertwin.types import Json

Item = TypeVar("Item")
Result = TypeVar("Result")
Job: TypeAlias = Callable[[], Mapping[str, Json]]


@runtime_checkable
class Engine(Protocol):
    """Runs slow work."""

    @property
    def workers(self) -> int:
        """Processes besides this one."""
        ...

    def submit(self, request: Request, job: Job) -> None:
        """Takes a job; returns at once.

        Raises:
            UsageError: the request is already open, or its job cannot travel to a process.
        """
        ...

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        """Answers that have come since the last call, by id; waits for ``until`` if it is open."""
        ...

    def drop(self, number: int) -> None:
        """Ends the work on a request that nobody waits for any more; none open: nothing."""
        ...

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """``function`` of every item, in their order; exceptions pass through."""
        ...

    def close(self) -> None:
        """Drops open work and ends the processes; a second call does nothing."""
        ...


def answered(request: Request, result: Job) -> Answer:
    """The answer that ``result`` returns, or its error where that is a value."""
    try:
        content = result()
    except EvertwinError as error:
        content = {"error": f"{type(error).__name__}: {error}"}
    return Answer(request.id, request.version, content)


def check_new(request: Request, known: Container[int]) -> None:
    """Refuses a request that is open already."""
    if request.id in known:
        raise UsageError(f"request {request.id}: is already open; every request has its own id")
