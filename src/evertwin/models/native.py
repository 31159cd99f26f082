"""C functions by address: signatures, how they are compiled, how compiled code calls them.

The signatures of a model's kernel are

    step(context*, x*, u*, dt, p*, x_next*, y*) -> int64        0: fine, else y is an error
    observe(context*, x*, y*) -> int64                          adopts y (NaN: nothing) into x

written as ``@cfunc(STEP)`` on plain functions, so that the same source runs in plain Python for
the tests. Nothing is compiled, or read from Numba's cache, before an address is asked for: a file
may hold the kernels of many machines.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_P = types.CPointer(types.float64)
_C = types.CPointer(types.int64)
STEP = types.int64(_C, _P, _P, types.float64, _P, _P, _P)
OBSERVE = types.int64(_C, _P, _P)


class CFunction:
    """A plain function that is a C function once its address is asked for; see `cfunc`.

    >>> @cfunc(OBSERVE)
    ... def nothing(context, x, y):
    ...     return 0
    >>> nothing.py_func(None, None, None)
    0
    """

    def __init__(self, py_func: Callable[..., Any], signature: Any, options: Any) -> None:
        self.py_func, self._signature, self._options = py_func, signature, options

    @cached_property
    def _compiled(self) -> Any:
        return numba.cfunc(self._signature, cache=True, **self._options)(self.py_func)

    @property
    def address(self) -> int:
        """Where its machine code stands, for as long as this object lives."""
        return int(self._compiled.address)


def cfunc(signature: Any, **options: Any) -> Callable[[Callable[..., Any]], CFunction]:
    """Decorates a plain function that others call by address; compiled when that is first asked.

    Args:
        signature: `STEP` or `OBSERVE`.
        options: of `numba.cfunc`; always cached.
    """
    return lambda py_func: CFunction(py_func, signature, options)


def calling(builder: Any, arguments: list[Any], kinds: list[ir.Type]) -> Any:
    """Emits a call of the C function whose address is the first argument."""
    function = ir.FunctionType(ir.IntType(64), kinds)
    pointer = builder.inttoptr(arguments[0], function.as_pointer())
    values = [
        builder.inttoptr(a, k) if isinstance(k, ir.PointerType) else a
        for a, k in zip(arguments[1:], kinds, strict=True)
    ]
    return builder.call(pointer, values)


@intrinsic
def scratch(typing: Any, size: Any) -> Any:
    """Room for ``size`` numbers until the function that asks returns; not for one that loops."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.alloca(ir.DoubleType(), arguments[0])

    return _P(types.int64), code


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
