"""What roll-outs and inverse dynamics have in common: the file, its parameters, the engines."""

from __future__ import annotations

import copy
import os
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self, TypeVar

import mujoco

from evertwin.models.mujoco.engine import Engine
from evertwin.models.mujoco.guard import Source, read_file, read_text
from evertwin.models.mujoco.knobs import Knob
from evertwin.models.one_line import one_line
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout
from evertwin.types import ParameterVector

Result = TypeVar("Result")


class EnginePool:
    """Engines of one model on loan: one for each thread that simulates, made when needed and kept.

    Parameters are written into an engine when it is lent with others than it holds.

    >>> EnginePool(None, ()).threads >= 1
    True
    """

    def __init__(self, model: Any, knobs: Sequence[Knob], threads: int = 0) -> None:
        """``threads`` at most at once; 0: one for each processor."""
        self.model, self.knobs = model, tuple(knobs)
        self.threads = threads or os.cpu_count() or 1
        self._free: list[Engine] = []
        self._lock = threading.Lock()

    @contextmanager
    def engine(self, p: ParameterVector) -> Iterator[Engine]:
        """An engine that holds the parameters ``p``, for as long as the block lasts."""
        with self._lock:
            engine = self._free.pop() if self._free else None
        engine = engine or Engine(copy.copy(self.model))
        key = p.tobytes()
        if engine.written != key:
            for knob, value in zip(self.knobs, p.tolist(), strict=True):
                knob.write(engine.model, value)
            mujoco.mj_setConst(engine.model, engine.data)
            engine.written = key
        try:
            yield engine
        finally:
            with self._lock:
                self._free.append(engine)

    def map(self, work: Callable[[int], Result], count: int) -> list[Result]:
        """``work(0) … work(count − 1)``, in threads; MuJoCo lets go of Python's lock."""
        if count == 1 or self.threads == 1:
            return [work(j) for j in range(count)]
        with ThreadPoolExecutor(min(self.threads, count)) as threads:
            return list(threads.map(work, range(count)))


@dataclass(frozen=True, eq=False)
class FromFile(ABC):
    """Base of models read from MJCF or URDF.

    >>> FromFile.__name__
    'FromFile'
    """

    __repr__ = one_line

    source: Source
    compiled: Any
    """MuJoCo's compiled model, never changed."""
    knobs: tuple[Knob, ...]
    """What the parameters are in the compiled model."""
    inputs: Layout
    outputs: Layout
    parameters: Parameters
    threads: int
    """Threads of `simulate_batch`; 0: one for each processor."""

    @classmethod
    def of(cls, file: str | Path, **options: Any) -> Self:
        """The model in a file; what it names (meshes, includes) must lie in its folder.

        Raises:
            ModelError: the file is refused, by us or by MuJoCo, or holds what the model cannot be.
            UsageError: an option does not fit the model.
        """
        return cls.built(read_file(file), **options)

    @classmethod
    def from_text(cls, text: str, **options: Any) -> Self:
        """The same from XML at hand."""
        return cls.built(read_text(text), **options)

    @classmethod
    @abstractmethod
    def built(cls, source: Source, **options: Any) -> Self:
        """The model of a checked source; says which options there are."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out of the file."""
        return self.source.notes

    def __getstate__(self) -> dict[str, Any]:
        """Without the engines: they belong to this process."""
        return {
            key: value for key, value in self.__dict__.items() if key not in ("_engines", "_rooms")
        }

    @cached_property
    def _engines(self) -> EnginePool:
        return EnginePool(self.compiled, self.knobs, self.threads)
