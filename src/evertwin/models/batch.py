"""Many parameter vectors over the same rows: what differences, multi-start and sweeps are made of.

A model that can do it itself (`BatchModel`) does; a compiled kernel runs in threads, since it
neither allocates nor shares memory; a Python function goes one after the other.

>>> from evertwin.models.functions.function import FunctionModel
>>> from evertwin.models.kernels.kernel import Restart
>>> from evertwin.models.parameters import Parameters
>>> from evertwin.signals import Layout
>>> gain = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(u="1"),
...     Layout.of(y="1"), Layout(), Parameters.of(k=(1.0, "1")))
>>> rows = np.ones((1, 1)), np.ones(1)
>>> Batch(gain).run(*rows, np.array([[2.0], [3.0]]), Restart.never(1, 1)).ravel().tolist()
[2.0, 3.0]
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.models.contract import Model, PartialModel
from evertwin.models.functions.function import kernel_of
from evertwin.models.kernels.kernel import Kernel, Restart
from evertwin.models.kernels.rollout import contiguous, roll, roll_rows
from evertwin.types import (
    Float64,
    Inputs,
    Intervals,
    OutputRuns,
    Outputs,
    ParameterVector,
    ParameterVectors,
    StateVectors,
)

WORTH = 20_000
"""Rows, over all parameter vectors together, from which on threads pay: to wake them takes as long
as some thousand rows of a small model."""


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Threads that stay; a ``process`` that was forked has none of its parent's."""
    return ThreadPoolExecutor(threads)


@njit(cache=True, nogil=True)
def _free(
    step: int, observe: int, context: Any, rows: tuple[Any, ...], x: Any, p: Any, out: Any
) -> None:
    """The loop of a native kernel, while other threads run theirs."""
    roll_rows(step, observe, context, rows, x, p, out)


def is_native(kept: Any) -> bool:
    """Does a kernel stay out of Python? Callbacks hold the interpreter's lock.

    >>> is_native(Kernel(0, 0, np.zeros(1, dtype=np.int64)))
    True
    """
    if isinstance(kept, Kernel):
        return kept.remote is None and is_native(kept.keep)
    if isinstance(kept, tuple):
        return all(is_native(one) for one in kept)
    return not hasattr(kept, "argtypes")  # of a ctypes callback


@dataclass(frozen=True)
class Batch:
    """Roll-outs of one model. See the module for an example."""

    model: Model
    workers: int = 0
    """Threads; 0: as many as there are processors."""

    @cached_property
    def kernel(self) -> Kernel:
        """The model's kernel, or one made of its Python functions."""
        return kernel_of(self.model)

    @cached_property
    def _together(self) -> bool:
        return hasattr(self.model, "simulate_batch")  # a contract asks for every attribute

    def run(
        self, u: Inputs, dt: Intervals, p: ParameterVectors, restart: Restart,
        starts: StateVectors | None = None,
    ) -> OutputRuns:  # fmt: skip
        """Outputs under each parameter vector, each from its own initial state, unless ``starts``
        (k, nx) says another; NaN: diverged."""
        if starts is None:
            starts = np.stack([self.model.initial(one) for one in p])
        if self._together:
            return np.asarray(self.model.simulate_batch(starts, u, dt, p, restart))  # type: ignore[attr-defined]
        return rolled(self.kernel, starts, (u, dt, restart), p, self.workers)


def mapped(model: Model, u: Inputs, dt: Intervals, p: ParameterVector) -> Outputs:
    """Outputs of a static map; of one that is linear in its numbers all rows at once.

    >>> from evertwin.machines.drive import DriveForce
    >>> mapped(DriveForce(), np.zeros((2, 2)), np.ones(2), DriveForce().parameters.values).shape
    (2, 1)
    """
    rows = model.initial(p), u, dt, p
    if isinstance(model, PartialModel):
        return model.partial(*rows, np.full_like(model.columns, -1))[0]
    return model.simulate(*rows)[1]


def rolled(
    kernel: Kernel, starts: Any, rows: tuple[Inputs, Intervals, Restart], p: ParameterVectors,
    workers: int = 0,
) -> OutputRuns:  # fmt: skip
    """Roll-outs of a kernel, each from its own state: in threads where that pays."""
    u, dt, restart = rows
    out = np.empty((len(p), len(u), restart.y.shape[1]))
    small = len(p) == 1 or len(p) * len(u) < WORTH or not is_native(kernel)
    if small or (threads := workers or os.cpu_count() or 1) == 1:  # counting takes 0.1 ms
        for j, one in enumerate(p):
            out[j] = roll(kernel, starts[j], u, dt, one, restart._replace(x0=starts[j]))[1]
        return out
    step, observe = int(kernel.step), int(kernel.observe)

    def run(j: int) -> None:
        own = contiguous(u, dt, restart._replace(x0=starts[j]))
        state, values = starts[j].copy(), np.ascontiguousarray(p[j])
        _free.compiled(step, observe, kernel.context, own, state, values, out[j])

    list(_pool(threads, os.getpid()).map(run, range(len(p))))
    return out


def grouped(own: Float64[np.ndarray, "k m"], work: Callable[[list[int]], OutputRuns]) -> OutputRuns:
    """Runs of a wrapper around a `BatchModel`: those with the same inputs go in one batch.

    Args:
        own: what the inputs of each run depend on, (k, m).
        work: outputs of the runs with the given numbers, whose rows of ``own`` have the same bits.

    >>> grouped(np.array([[1.0], [2.0], [1.0]]), lambda of: np.full((len(of), 1, 1), of[0])).ravel()
    array([0., 1., 0.])
    """
    groups: dict[bytes, list[int]] = {}
    for j, one in enumerate(own):
        groups.setdefault(one.tobytes(), []).append(j)
    members = list(groups.values())
    if len(members) == 1:
        return work(members[0])
    with ThreadPoolExecutor(min(os.cpu_count() or 1, len(members))) as pool:
        found = list(pool.map(work, members))
    out = np.empty((len(own), *found[0].shape[1:]))
    for numbers, runs in zip(members, found, strict=True):
        out[numbers] = runs
    return out
