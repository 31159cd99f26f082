"""Calls of C functions by their address.

>>> from evertwin.compiled.functions import OBSERVE, cfunc
>>> @cfunc(OBSERVE)
... def keep(context, x, y):
...     x[0] = y[0]
...     return 0
>>> x, y, context = np.zeros(1), np.array([2.5]), np.zeros(1, dtype=np.int64)
>>> call(keep, context.ctypes.data, x.ctypes.data, y.ctypes.data), x[0]
(0, np.float64(2.5))
"""

from __future__ import annotations

import ctypes
import re
from functools import lru_cache
from typing import Any, SupportsIndex

import numpy as np

from evertwin.compiled.functions import CFunction, instead

_KINDS = {"int64": ctypes.c_int64, "float64": ctypes.c_double}


@instead("evertwin.compiled.intrinsics:call")
def call(address: SupportsIndex, *numbers: float) -> int:
    """What the C function at ``address`` gives, a whole number.

    Args:
        address: a number, or a `CFunction`, which then runs plain.
        numbers: floats and whole numbers; arrays and pointers, or their addresses.
    """
    if isinstance(address, CFunction):
        try:
            return int(_plainly(address, numbers))
        except (ArithmeticError, ValueError):
            pass  # machine code goes on with inf or nan where Python's own numbers raise
    return int(_natively(ctypes.c_int64, int(address), numbers))


@instead("evertwin.compiled.intrinsics:call_real")
def call_real(address: SupportsIndex, *numbers: float) -> float:
    """What the C function at ``address`` gives, a float; arguments as for `call`."""
    return float(_natively(ctypes.c_double, int(address), numbers))


def _natively(result: Any, address: int, numbers: tuple[Any, ...]) -> Any:
    given = [n if isinstance(n, float) else _whole(n) for n in numbers]
    return _prototype(result, tuple(isinstance(n, float) for n in given))(address)(*given)


def _whole(number: Any) -> int:
    """A whole number, or where an array or what a pointer points to begins."""
    if isinstance(number, np.ndarray):
        return int(number.ctypes.data)
    return ctypes.addressof(number.contents) if hasattr(number, "contents") else int(number)


@lru_cache
def _prototype(result: Any, floats: tuple[bool, ...]) -> Any:
    kinds = [ctypes.c_double if real else ctypes.c_int64 for real in floats]
    return ctypes.CFUNCTYPE(result, *kinds)


def _plainly(function: CFunction, numbers: tuple[float, ...]) -> Any:
    kinds = _pointers(function.signature)
    given = [n if kind is None else ctypes.cast(int(n), kind) for n, kind in zip(numbers, kinds)]
    with np.errstate(all="ignore"):
        return function.plain(*given)


@lru_cache
def _pointers(signature: str) -> tuple[Any, ...]:
    """The pointer type of each argument, None for a number."""
    found = re.findall(r"CPointer\((\w+)\)|(\w+)", signature.partition("(")[2])
    return tuple(ctypes.POINTER(_KINDS[to]) if to else None for to, _ in found)
