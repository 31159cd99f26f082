"""How hard to search, who watches, and where roll-outs run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from evertwin.errors import UsageError
from evertwin.models import Model


class Far(NamedTuple):
    """Roll-outs in other processes, for models that hold the interpreter (Python functions).

    >>> Far(lambda f, items: [f(i) for i in items], dict, "tank").workers
    2
    """

    map: Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]
    """Of an engine with processes: `evertwin.engine.Pool.map`."""
    build: Callable[[], Model]
    """Builds the model there; picklable, as ``functools.partial`` of a module's function is."""
    key: str
    """Names the model: a process keeps what it has built under it."""
    workers: int = 2
    """Parts that the columns are cut into."""


@dataclass(frozen=True)
class Settings:
    """How hard to try.

    >>> Settings().starts
    1
    """

    evaluations: int = 200
    """Most residual evaluations per start, differences not counted."""
    starts: int = 1
    """Starts: the given one, then a Latin hypercube over the bounds (or start ± size)."""
    seed: int = 0
    tolerance: float = 1e-10
    """Relative change of cost or parameters that ends the search."""
    progress: Callable[[int, float], bool] | None = None
    """Called with (evaluations so far, cost); False stops and keeps the best so far."""
    interrupt: bool = False
    """Ctrl-C stops the search and keeps the best so far; a second one ends the program."""
    lenient: bool = False
    """A parameter that changes no output anywhere stays as it is, and is no error."""
    begin: tuple[tuple[str, float], ...] = ()
    """Names and values that the search begins with; the others begin as the problem says."""
    quick: bool = False
    """Of a hypothesis only what it leaves is asked: neither what the noise of measured starts does
    to the numbers, which takes longer than the search, nor which form would be the right one."""
    far: Far | None = None
    """Where differences are simulated; absent: in this process, in threads where they pay."""

    def __post_init__(self) -> None:
        if self.evaluations < 1 or self.starts < 1:
            raise UsageError(
                f"tuning: expected at least 1 evaluation and 1 start, got {self.evaluations} and "
                f"{self.starts}"
            )
