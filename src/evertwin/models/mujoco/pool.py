"""Engines on loan: one for each thread that simulates, made when needed and kept.

Parameters are written into an engine when it is lent with others than it holds.
"""

from __future__ import annotations

import copy
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

import mujoco

from evertwin.models.mujoco.engine import Engine
from evertwin.models.mujoco.knobs import Knob
from evertwin.types import ParameterVector

Result = TypeVar("Result")


class EnginePool:
    """Engines of one model.

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
