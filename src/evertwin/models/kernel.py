"""Compiled models: C functions called by address from one fused loop.

A position update changes the state inside a block, so simulating and judging are one loop, and
Numba caches such a loop only when the model comes in as an address. The signatures are

    step(context*, x*, u*, dt, p*, x_next*, y*) -> int64        0: fine, else y is an error
    observe(context*, x*, y*) -> int64                          adopts y (NaN: nothing) into x

with ``context`` an int64 array that a model may use as it likes: a wrapper keeps the addresses of
the inner kernel there. A kernel must not raise: a return code other than 0, or NaN, tells.
``x`` and ``x_next`` never overlap.

Written as ``@cfunc(STEP, cache=True)`` on plain functions, so that the same source runs in plain
Python for the tests (see `pointer_twin`). A model in plain Python enters by the same signatures,
at about a microsecond a row. A model that lives in another process (`Remote`) has the whole loop
run there, with the kernels of its wrappers: see `looped`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from evertwin.types import Inputs, Intervals, Outputs, ParameterVector, StateVector

__all__ = [
    "ADOPT",
    "ANEW",
    "CONTINUE",
    "OBSERVE",
    "STEP",
    "Kernel",
    "Layer",
    "Remote",
    "Restart",
    "call_observe",
    "call_step",
    "calling",
    "looped",
    "roll",
]

_P = types.CPointer(types.float64)
_C = types.CPointer(types.int64)
STEP = types.int64(_C, _P, _P, types.float64, _P, _P, _P)
OBSERVE = types.int64(_C, _P, _P)


CONTINUE, ADOPT, ANEW = 0, 1, 2


class Restart(NamedTuple):
    """Where a roll-out starts again from measured outputs: predictions over one horizon.

    >>> Restart(np.zeros((1, 1)), np.zeros(1, dtype=np.uint8), np.zeros(1)).code.tolist()
    [0]
    """

    y: Outputs
    """Measured outputs of the rows, (n, ny); NaN adopts nothing."""
    code: np.ndarray
    """uint8, (n,): CONTINUE; ADOPT the outputs of the row before (never at row 0 of the call),
    then simulate; ANEW: from ``x0`` and this row's outputs, which are not predicted (NaN)."""
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

    step: int
    observe: int
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


def calling(builder: Any, arguments: list[Any], kinds: list[ir.Type]) -> Any:
    """Emits a call of the C function whose address is the first argument."""
    function = ir.FunctionType(ir.IntType(64), kinds)
    pointer = builder.inttoptr(arguments[0], function.as_pointer())
    values = [
        builder.inttoptr(a, k) if isinstance(k, ir.PointerType) else a
        for a, k in zip(arguments[1:], kinds, strict=True)
    ]
    return builder.call(pointer, values)


_I64, _F64 = ir.IntType(64), ir.DoubleType()
_STEP_KINDS = [_I64.as_pointer(), *[_F64.as_pointer()] * 2, _F64, *[_F64.as_pointer()] * 3]
_OBSERVE_KINDS = [_I64.as_pointer(), _F64.as_pointer(), _F64.as_pointer()]


@intrinsic
def call_step(
    typing: Any, address: Any, context: Any, x: Any, u: Any, dt: Any, p: Any, x_next: Any, y: Any
) -> Any:
    """``step`` at ``address``; every array is given by its address (``a.ctypes.data``)."""
    integers = [types.int64] * 4
    signature = types.int64(*integers, types.float64, *[types.int64] * 3)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return calling(builder, list(arguments), _STEP_KINDS)

    return signature, code


@intrinsic
def call_observe(typing: Any, address: Any, context: Any, x: Any, y: Any) -> Any:
    """``observe`` at ``address``; changes ``x`` in place."""
    signature = types.int64(types.int64, types.int64, types.int64, types.int64)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return calling(builder, list(arguments), _OBSERVE_KINDS)

    return signature, code


@njit(cache=True)
def _roll(
    step: int, observe: int, context: Any, x: Any, u: Any, dt: Any, p: Any, y: Any, code: Any,
    x0: Any, out: Any,
) -> None:  # fmt: skip
    """One pass over the rows: restart (where asked), step, store."""
    n, nu, ny = u.shape[0], u.shape[1], out.shape[1]
    ahead = np.empty_like(x)
    u_at, out_at, y_at = u.ctypes.data, out.ctypes.data, y.ctypes.data
    c, a, b, parameters = context.ctypes.data, x.ctypes.data, ahead.ctypes.data, p.ctypes.data
    for i in range(n):
        if code[i] == ANEW:
            x[:] = x0
            out[i, :] = np.nan
            call_observe(observe, c, a, y_at + 8 * i * ny)
            continue
        if code[i] == ADOPT:
            call_observe(observe, c, a, y_at + 8 * (i - 1) * ny)
        failed = call_step(step, c, a, u_at + 8 * i * nu, dt[i], parameters, b, out_at + 8 * i * ny)
        if failed != 0:
            out[i, :] = np.nan
        x[:] = ahead


def roll(
    kernel: Kernel,
    x: StateVector,
    u: Inputs,
    dt: Intervals,
    p: ParameterVector,
    restart: Restart,
) -> tuple[StateVector, Outputs]:
    """Rows simulated by a kernel: (state after the last, outputs (n, ny)).

    A row whose step failed is NaN, and so is a row that starts anew.
    """
    state = np.array(x, dtype=np.float64)
    out = np.empty((len(u), restart.y.shape[1]))
    looped(
        _roll, kernel, state, np.ascontiguousarray(u), np.ascontiguousarray(dt),
        np.ascontiguousarray(p), np.ascontiguousarray(restart.y), restart.code,
        np.array(restart.x0, dtype=np.float64), out,
    )  # fmt: skip
    return state, out
