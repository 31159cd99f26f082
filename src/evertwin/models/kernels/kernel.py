"""Compiled models: C functions called by address from one fused loop.

A position update changes the state inside a block, so simulating and judging are one loop, and
Numba caches such a loop only when the model comes in as an address: see `STEP` in
`evertwin.compiled.functions`. ``context`` is an int64 array that a model may use as it likes: a
wrapper keeps the addresses of the inner kernel there. A kernel must not raise: a return code other
than 0 (`RAISED`: what the user wrote raised something), or NaN, tells. ``x`` and ``x_next`` never
overlap.

A model in plain Python enters by the same signatures, at about a microsecond a row. A model that
lives in another process (`Remote`) has the whole loop run there, with the kernels of its wrappers:
see `looped`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, SupportsIndex

import numpy as np

from evertwin.types import Outputs, StateVector

CONTINUE, ADOPT, ANEW, GAP = 0, 1, 2, 3
RAISED = 2
"""Bit of a step's return code: the row is none that the model can compute."""


class Restart(NamedTuple):
    """Where a roll-out starts again from measured outputs: predictions over one horizon.

    >>> Restart(np.zeros((1, 1)), np.zeros(1, dtype=np.uint8), np.zeros(1)).code.tolist()
    [0]
    """

    y: Outputs
    """Measured outputs of the rows, (n, ny); NaN adopts nothing."""
    code: np.ndarray
    """uint8, (n,): CONTINUE; ADOPT the outputs of the row before (never at row 0 of the call),
    then simulate; ANEW: from ``x0`` and this row's outputs, which are not predicted (NaN); GAP: as
    ANEW, from the state before the row."""
    x0: StateVector
    """State that ANEW starts from."""

    @classmethod
    def never(cls, rows: int, outputs: int) -> Restart:
        """One run without restarts."""
        return cls(np.empty((0, outputs)), np.zeros(rows, dtype=np.uint8), np.empty(0))


class Layer(NamedTuple):
    """A wrapper's kernel, by name: addresses mean nothing in another process.

    >>> Layer("evertwin.models.terms.kernel", np.zeros(4, dtype=np.int64)).plan.tolist()
    [0, 0, 0, 0]
    """

    module: str
    """Holds the compiled ``step`` and ``adopt``."""
    plan: np.ndarray
    """Its context, int64; entries 1 to 3 are the inner step, observe and context."""
    terms: tuple[str, ...] = ()
    """Kinds whose functions the plan holds: ``resolve(plan, terms)`` of the module finds them."""


class Remote(Protocol):
    """A process that runs loops over the model that it holds.

    >>> hasattr(Remote, "run")
    True
    """

    @property
    def alive(self) -> bool:
        """Can it run one? Where not, the loop runs here and every step fails."""
        ...

    def run(
        self, loop: Callable[..., Any], layers: Sequence[Layer], arguments: Sequence[Any]
    ) -> tuple[bool, Any]:
        """(True, what ``loop(step, observe, context, *arguments)`` gives); arrays change in place.

        (False, None) where it could not be done: then no array has changed.
        """
        ...

    def news(self) -> tuple[str, ...]:
        """What went wrong since the last call, one sentence each."""
        ...


class Kernel(NamedTuple):
    """Addresses of a model's compiled functions.

    >>> Kernel(0, 0, np.zeros(1, dtype=np.int64)).keep
    ()
    """

    step: SupportsIndex
    observe: SupportsIndex
    """Addresses, or functions that tell theirs once machine code needs it (`CFunction`)."""
    context: np.ndarray
    """int64, (k,), at least one entry; stays alive as long as the kernel is used."""
    keep: tuple[Any, ...] = ()
    """Objects that must outlive the addresses (ctypes callbacks, inner contexts)."""
    remote: Remote | None = None
    """Where the innermost model lives, if not here; the addresses are callbacks that ask it."""
    layers: tuple[Layer, ...] = ()
    """Kernels of the wrappers around a remote model, innermost first."""

    def over(self, inner: Kernel, layer: Layer, keep: tuple[Any, ...]) -> Kernel:
        """This kernel as the wrapper ``layer`` around ``inner``."""
        layers = (*inner.layers, layer) if inner.remote else ()
        return self._replace(keep=(*keep, inner), remote=inner.remote, layers=layers)


def looped(loop: Callable[..., Any], kernel: Kernel, *arguments: Any) -> Any:
    """``loop(step, observe, context, *arguments)``, run where the model lives.

    ``loop`` is a compiled function of a module; arguments are arrays and numbers, also in tuples.
    """
    if kernel.remote is not None and kernel.remote.alive:
        done, result = kernel.remote.run(loop, kernel.layers, arguments)
        if done:
            return result
    return loop(kernel.step, kernel.observe, kernel.context, *arguments)
